//! The customs office: foreign files to ours, with provenance and limits.
