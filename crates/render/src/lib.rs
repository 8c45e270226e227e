//! Draws shaded meshes into PNG pictures without a window.
