//! Measures, baselines, protocols and the report.
