//! Reflectance models, measured tables and their file formats
