//! The command line of gonio
