//! Few colours for many pictures, by median cut: a box that holds all colours is divided again and again, each time at
//! the median along its longest side.

use image::RgbImage;

/// Pictures of a common palette.
pub struct Indexed {
    pub size: [u32; 2],
    /// Bytes of red, green and blue.
    pub palette: Vec<u8>,
    /// An index per pixel.
    pub pictures: Vec<Vec<u8>>,
}

/// Colours in a palette. With more the pictures' shades are smoother, and the file is larger.
const COLOURS: usize = 112;
/// Bits of a channel that tell colours apart.
const BITS: u32 = 6;

pub struct Palette {
    colours: Vec<[u8; 3]>,
    /// Index of the colour of each cell, by [`cell`].
    of_cell: Vec<u8>,
}

/// The cell that a colour lies in.
fn cell(pixel: [u8; 3]) -> usize {
    pixel.iter().fold(0, |cell, &channel| cell << BITS | usize::from(channel >> (8 - BITS)))
}

/// Coordinate of a cell along a channel.
fn along(cell: usize, channel: usize) -> usize {
    cell >> (BITS as usize * (2 - channel)) & ((1 << BITS) - 1)
}

impl Palette {
    pub fn of(pictures: &[RgbImage]) -> Palette {
        let mut counts = vec![0u64; 1 << (3 * BITS)];
        let mut sums = vec![[0u64; 3]; counts.len()];
        for &image::Rgb(pixel) in pictures.iter().flat_map(|picture| picture.pixels()) {
            let cell = cell(pixel);
            counts[cell] += 1;
            (0..3).for_each(|c| sums[cell][c] += u64::from(pixel[c]));
        }
        // Rare colours count for more than their pixels: a highlight is small, but it is looked at.
        let weight = |cell: usize| (counts[cell] as f64).sqrt();
        let range = |cells: &[usize], channel: usize| {
            let places = cells.iter().map(|&cell| along(cell, channel));
            places.clone().max().unwrap_or(0) - places.min().unwrap_or(0)
        };
        let longest = |cells: &[usize]| (0..3).max_by_key(|&c| range(cells, c)).unwrap_or(0);
        let mut boxes = vec![(0..counts.len()).filter(|&cell| counts[cell] > 0).collect::<Vec<_>>()];
        while boxes.len() < COLOURS {
            let loss = |cells: &Vec<usize>| {
                cells.iter().map(|&cell| weight(cell)).sum::<f64>()
                    * (range(cells, longest(cells)) as f64).powi(2)
            };
            let losses = boxes.iter().map(loss).enumerate();
            let Some((largest, _)) =
                losses.filter(|(_, loss)| *loss > 0.0).max_by(|a, b| a.1.total_cmp(&b.1))
            else {
                break;
            };
            let mut cells = boxes.swap_remove(largest);
            let channel = longest(&cells);
            cells.sort_by_key(|&cell| along(cell, channel));
            let half = cells.iter().map(|&cell| weight(cell)).sum::<f64>() / 2.0;
            let mut before = 0.0;
            let median = cells.iter().position(|&cell| {
                before += weight(cell);
                before >= half
            });
            let rest = cells.split_off(median.unwrap_or(0).clamp(1, cells.len() - 1));
            boxes.extend([cells, rest]);
        }
        let mut of_cell = vec![0; counts.len()];
        let mut colours = Vec::new();
        for (index, cells) in boxes.iter().enumerate() {
            let count = cells.iter().map(|&cell| counts[cell]).sum::<u64>().max(1);
            let mean = |c: usize| (cells.iter().map(|&cell| sums[cell][c]).sum::<u64>() + count / 2) / count;
            colours.push([0, 1, 2].map(|c| mean(c) as u8));
            cells.iter().for_each(|&cell| of_cell[cell] = index as u8);
        }
        Palette { colours, of_cell }
    }

    pub fn index(&self, pictures: &[RgbImage]) -> Indexed {
        let of = |picture: &RgbImage| picture.pixels().map(|pixel| self.of_cell[cell(pixel.0)]).collect();
        Indexed {
            size: pictures.first().map_or([0; 2], |picture| picture.dimensions().into()),
            palette: self.colours.concat(),
            pictures: pictures.iter().map(of).collect(),
        }
    }
}
