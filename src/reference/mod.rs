//! The f64 reference integrator.
