/// Linear RGB in `[0, 1]`.
pub type Colour = [f32; 3];

/// A magnitude in `[0, 1]` as a colour from dark blue through green to yellow: seven stops whose lightness rises
/// steadily, so that it also reads in grey. Values outside are clamped; NaN is magenta.
pub fn colour_of_magnitude(x: f32) -> Colour {
    const STOPS: [[u8; 3]; 7] =
        [[64, 10, 84], [66, 61, 132], [47, 104, 142], [33, 145, 140], [57, 184, 120], [146, 214, 70], [253, 231, 37]];
    if x.is_nan() {
        return [1.0, 0.0, 1.0];
    }
    let at = x.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let i = (at as usize).min(STOPS.len() - 2);
    let t = at - i as f32;
    std::array::from_fn(|c| {
        let linear = |b: u8| (f32::from(b) / 255.0).powf(2.2);
        linear(STOPS[i][c]) * (1.0 - t) + linear(STOPS[i + 1][c]) * t
    })
}

/// A colour in eight bits a channel, as files and screens have them; clamped.
pub fn bytes_of_colour(linear: Colour) -> [u8; 3] {
    linear.map(|c| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0).round() as u8)
}

/// Colours of magnitudes against a full scale (in the same unit).
pub fn colours_of_magnitudes(magnitudes: &[f32], full_scale: f32) -> Vec<Colour> {
    magnitudes.iter().map(|m| colour_of_magnitude(m / full_scale.max(f32::MIN_POSITIVE))).collect()
}
