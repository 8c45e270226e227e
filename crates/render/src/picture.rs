use std::io::Write;

/// 8-bit sRGB pixels, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// `[height, width]`.
    pub pixels: Vec<[u8; 3]>,
}

/// What can go wrong with a picture.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The encoder or the writer behind it failed.
    #[error("the picture cannot be written as PNG: {0}")]
    Encode(#[from] png::EncodingError),
}

impl Picture {
    /// One colour everywhere.
    pub fn filled(width: usize, height: usize, colour: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    /// Pictures of one height side by side. Panics if the heights differ.
    pub fn row(pictures: &[Self]) -> Self {
        let height = pictures.first().map_or(0, |p| p.height);
        assert!(pictures.iter().all(|p| p.height == height), "pictures in a row have one height");
        let mut out = Self::filled(pictures.iter().map(|p| p.width).sum(), 0, [0; 3]);
        out.height = height;
        for y in 0..height {
            for p in pictures {
                out.pixels.extend_from_slice(&p.pixels[y * p.width..(y + 1) * p.width]);
            }
        }
        out
    }

    /// Pictures of one width below each other. Panics if the widths differ.
    pub fn column(pictures: &[Self]) -> Self {
        let width = pictures.first().map_or(0, |p| p.width);
        assert!(pictures.iter().all(|p| p.width == width), "pictures in a column have one width");
        let pixels: Vec<[u8; 3]> = pictures.iter().flat_map(|p| p.pixels.iter().copied()).collect();
        Self { width, height: pictures.iter().map(|p| p.height).sum(), pixels }
    }

    /// Encodes as PNG.
    pub fn write_png(&self, to: impl Write) -> Result<(), PictureError> {
        let mut encoder = png::Encoder::new(to, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        writer.finish()?;
        Ok(())
    }

    /// The PNG file's bytes.
    pub fn to_png(&self) -> Result<Vec<u8>, PictureError> {
        let mut bytes = Vec::new();
        self.write_png(&mut bytes)?;
        Ok(bytes)
    }
}
