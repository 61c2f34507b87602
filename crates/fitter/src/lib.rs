//! Fits of reflectance models: variable projection, Levenberg-Marquardt, parameter uncertainty
