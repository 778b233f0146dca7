//! An image in memory. Files are read and written by `file`.

/// Linear-light RGBA with colour premultiplied by alpha, row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// `width * height` pixels.
    pub rgba: Vec<[f32; 4]>,
}

impl Image {
    /// An image of transparent black.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, rgba: vec![[0.0; 4]; width as usize * height as usize] }
    }
}
