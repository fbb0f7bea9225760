//! Several outputs of one and the same solve: images of tiles, and carried points.

use super::carrier::{Carried, Carrier};
use super::results::{Last, Results};
use crate::map::FetchKind;
use crate::map::fetch::Output;
use vrtm_core::allocation::Vec;
use vrtm_core::error::Result;
use vrtm_core::image::ImageViewMut;
use vrtm_core::team::Team;

/// One output of [`crate::Asset::redirect`] or [`crate::Results::fetch_all`].
#[derive(Debug)]
pub enum Fetch<'a> {
    /// An image of a tile.
    Image {
        /// Index of the tile.
        tile: usize,
        /// The kind of image.
        kind: FetchKind,
        /// The destination.
        image: ImageViewMut<'a>,
    },
    /// Points in the pose, as [`Carrier::fetch`] writes them.
    Carried {
        /// A carrier of the same asset.
        carrier: &'a Carrier,
        /// The destinations.
        carried: Carried<'a>,
    },
}

impl Results {
    /// Writes outputs of one and the same solve, even if another one ends meanwhile.
    ///
    /// # Errors
    /// `InvalidArgument` for an unknown tile or another asset's carrier; otherwise as [`crate::Tile::fetch`] and
    /// [`Carrier::fetch`]. Nothing is written then, unless a GPU fails while the images are written.
    pub fn fetch_all(&self, fetches: &mut [Fetch]) -> Result<()> {
        self.check_fetches(fetches)?;
        let device = self.device();
        device.call(|| {
            device.alive()?;
            let last = self.last();
            device.team(|team| self.write_all(team, &last, fetches))
        })
    }

    /// Checks the tiles, the channels, the carriers and the arrays of fetches.
    pub(super) fn check_fetches(&self, fetches: &[Fetch]) -> Result<()> {
        fetches.iter().enumerate().try_for_each(|(k, fetch)| match fetch {
            Fetch::Image { tile, kind, image } => {
                self.check_tile(*tile)?;
                kind.check_channels(format_args!("fetches[{k}].image"), image.layout.channels)
            }
            Fetch::Carried { carrier, carried } => {
                ensure!(self.is(carrier.results()), "fetches[{k}].carrier belongs to another asset");
                carrier.check(carried, &format!("fetches[{k}].carried."))
            }
        })
    }

    /// Writes outputs of results, which may not be published yet.
    pub(super) fn write_all(&self, team: &Team, last: &Last, fetches: &mut [Fetch]) -> Result<()> {
        let (mut images, mut rides) = (Vec::new(), Vec::new());
        // All memory is allocated first, so that no output is written if memory runs short.
        for fetch in fetches {
            match fetch {
                Fetch::Image { tile, kind, image } => {
                    let result = last.tiles.get(*tile).and_then(Option::as_ref);
                    let solved = &result.ok_or_else(|| self.not_solved(*tile))?.solved;
                    let output = Output::new(self.mesh(), solved, *kind, image.part(), &image.layout)?;
                    images.push((output, image));
                }
                Fetch::Carried { carrier, carried } => rides.push((carrier.ride(team, last)?, &*carried)),
            }
        }
        let positions = last.pose.as_ref().map(|pose| pose.positions.view()).unwrap_or_default();
        let position = |v: u32| positions.get3(v as usize);
        let begun = rides.iter().map(|(ride, carried)| ride.begin(team, &position, carried));
        let begun: Vec<_> = begun.collect();
        for (output, image) in images {
            self.write(team, output, image)?;
        }
        begun.iter().for_each(|begun| begun.write(team));
        Ok(())
    }
}
