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

    /// One pixel of every square of `every` by `every`, the one at `every / 2` on each axis; incomplete squares are left out.
    /// `every`: at least 1.
    #[must_use]
    pub fn thinned(&self, every: u32) -> Self {
        let (width, height) = (self.width / every, self.height / every);
        let pixel = |x: u32, y: u32| {
            let (x, y) = (x * every + every / 2, y * every + every / 2);
            self.rgba[y as usize * self.width as usize + x as usize]
        };
        let rgba = (0..height).flat_map(|y| (0..width).map(move |x| pixel(x, y))).collect();
        Self { width, height, rgba }
    }
}
