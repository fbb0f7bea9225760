//! The thread that solves. It owns the asset; the window never waits for it.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Instant;

use vrtm::{
    Asset, Backend, Device, DeviceSettings, ErrorKind, ImageLayout, ImageView, MeshSource, PixelFormat,
    SolveOptions, SolveRequest, Strided, TileSettings, UvSource,
};

use super::answer::{Answer, Maps, Solved};
use super::inbox::{Edit, Inbox, Purpose, Request, Work};
use crate::brush::canvas::Canvas;
use crate::model::Model;
use crate::scenes::path::Path;

/// What the thread tells.
pub enum News {
    /// The device's name, and why it was chosen.
    Device(String),
    Solved(Box<Answer>),
    /// What went wrong.
    Failed(String),
}

/// The thread, and the way to it. Dropping it ends the thread.
pub struct Worker {
    pub inbox: Arc<Inbox>,
    news: Receiver<News>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// `wake` is called after each piece of news.
    pub fn new(backend: Backend, wake: impl Fn() + Send + 'static) -> Worker {
        let inbox = Arc::new(Inbox::default());
        let (sender, news) = channel();
        let thread = std::thread::spawn({
            let inbox = inbox.clone();
            move || {
                let told = Told { sender, wake: Box::new(wake) };
                let settings = DeviceSettings { backend, ..DeviceSettings::default() };
                match Device::new(&settings) {
                    Ok(device) => serve(&device, &inbox, &told),
                    Err(error) => told.tell(News::Failed(format!("--device: {error}"))),
                }
            }
        });
        Worker { inbox, news, thread: Some(thread) }
    }

    /// What there is to tell, the oldest first.
    pub fn news(&self) -> impl Iterator<Item = News> + '_ {
        self.news.try_iter()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.inbox.close();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Told {
    sender: Sender<News>,
    wake: Box<dyn Fn() + Send>,
}

impl Told {
    fn tell(&self, news: News) {
        // Nobody listens once the window is closed.
        let _ = self.sender.send(news);
        (self.wake)();
    }
}

fn serve(device: &Device, inbox: &Inbox, told: &Told) {
    let info = device.info();
    told.tell(News::Device(format!("{} ({})", info.name, info.reason)));
    let mut open: Option<Open> = None;
    let mut settings = TileSettings::default();
    while let Some(Work { edits, request, control }) = inbox.take() {
        for edit in edits {
            let changed = match edit {
                Edit::Open(model, canvases) => {
                    Open::new(device, model, canvases, &settings).map(|new| open = Some(new))
                }
                Edit::Settings(new) => {
                    settings = new;
                    open.as_mut().map_or(Ok(()), |open| open.set(&settings))
                }
                Edit::Paint { tile, rect, texels } => open.as_mut().map_or(Ok(()), |open| {
                    open.canvases[tile].paste(rect, &texels);
                    open.paint(tile, Some(rect))
                }),
            };
            if let Err(error) = changed {
                told.tell(News::Failed(error.message));
            }
        }
        if let (Some(request), Some(open)) = (request, &mut open) {
            match open.solve(request, control) {
                Ok(answer) => told.tell(News::Solved(Box::new(answer))),
                Err(error) if error.kind == ErrorKind::Cancelled => {}
                Err(error) => told.tell(News::Failed(error.message)),
            }
        }
        inbox.done();
    }
}

/// An open mesh.
struct Open {
    model: Arc<Model>,
    asset: Asset,
    /// The asset's tile for each of the model's; `None` if all of its triangles have no area.
    tiles: Vec<Option<usize>>,
    canvases: Vec<Canvas>,
    maps: Vec<Arc<Maps>>,
    /// How long strain was measured the last time.
    measure_ms: f64,
}

/// Milliseconds of measuring that a preview may take.
const CHEAP: f64 = 15.0;

impl Open {
    fn new(
        device: &Device,
        model: Arc<Model>,
        canvases: Vec<Canvas>,
        settings: &TileSettings,
    ) -> vrtm::Result<Open> {
        let mesh = &model.mesh;
        let asset = Asset::new(
            device,
            &MeshSource {
                positions: Strided::from_f32x3(&model.rest),
                face_counts: Some(&mesh.face_counts),
                indices: &mesh.indices,
                uvs: UvSource { u: Strided::from_f32x2(&mesh.uvs), v: None, indices: Some(&mesh.uv_indices) },
                ..MeshSource::default()
            },
        )?;
        let tiles = model.tiles.iter().map(|tile| asset.find_tile(tile.udim)).collect();
        let maps = model.tiles.iter().map(|_| Arc::new(Maps::identity())).collect();
        let mut open = Open { model, asset, tiles, canvases, maps, measure_ms: f64::MAX };
        for (tile, place) in open.tiles.clone().into_iter().enumerate() {
            open.paint(tile, None)?;
            let Some((place, mask)) = place.zip(open.model.tiles[tile].mask.clone()) else { continue };
            let layout = ImageLayout::packed(mask.size[0], mask.size[1], mask.format);
            open.asset.set_mask(place, Some(ImageView::new("mask", &mask.bytes, layout)?))?;
        }
        open.set(settings)?;
        Ok(open)
    }

    fn set(&mut self, settings: &TileSettings) -> vrtm::Result<()> {
        self.tiles.iter().flatten().try_for_each(|&tile| self.asset.set_settings(tile, settings))
    }

    /// Hands a tile's map over, or the part of it that a stroke changed.
    fn paint(&mut self, tile: usize, part: Option<crate::brush::canvas::Rect>) -> vrtm::Result<()> {
        let Some(place) = self.tiles[tile] else { return Ok(()) };
        let Canvas { size, texels, .. } = &self.canvases[tile];
        let layout = ImageLayout::packed(size[0], size[1], PixelFormat::U16);
        let view = ImageView::new("rigidity", bytemuck::cast_slice(texels), layout)?;
        match part {
            Some(rect) => self.asset.update_rigidity(place, view, rect.first, rect.size),
            None => self.asset.set_rigidity(place, Some(view)),
        }
    }

    fn solve(&mut self, request: Request, control: Arc<vrtm::Control>) -> vrtm::Result<Answer> {
        let keys = self.model.keys();
        let pose = match Path::through(keys.clone(), &self.model.timeline.keys) {
            Ok(path) => path.pose(request.frame.clamp(1, request.last)),
            // Rest alone.
            Err(_) => keys[0].to_vec(),
        };
        let start = Instant::now();
        // Grids that changed are built first, so that their time stands apart.
        for &tile in self.tiles.iter().flatten() {
            self.asset.tile_info(tile)?;
        }
        let build_ms = milliseconds(start);
        let options = SolveOptions {
            quality: request.quality,
            // Previews only where it takes no time that anybody notices.
            measure: request.purpose != Purpose::Preview || self.measure_ms < CHEAP,
            ..SolveOptions::default()
        };
        let solve = SolveRequest {
            positions: Strided::from_f32x3(&pose),
            options,
            control: Some(control),
            ..SolveRequest::default()
        };
        let start = Instant::now();
        self.asset.run(&solve, &mut [])?;
        let all_ms = milliseconds(start);
        let report = self.asset.report()?;
        let start = Instant::now();
        let mut tiles = Vec::new();
        for (k, place) in self.tiles.iter().enumerate() {
            let report = match place {
                Some(tile) => self.asset.tile_report(*tile)?,
                None => Default::default(),
            };
            if report.charts_active > 0 {
                self.maps[k] = Arc::new(Maps::fetch(&self.asset, place.unwrap_or_default(), &report)?);
            } else if report.charts_reused == 0 && !report.kept {
                self.maps[k] = Arc::new(Maps::identity());
            }
            tiles.push(Solved { maps: self.maps[k].clone(), report });
        }
        let fetch_ms = milliseconds(start);
        let solve_ms = f64::from(report.total_ms);
        let measure_ms = (all_ms - solve_ms).max(0.0);
        if options.measure {
            self.measure_ms = measure_ms;
        }
        let normals = Arc::new(self.model.normals(&pose));
        Ok(Answer {
            request,
            positions: Arc::new(pose),
            normals,
            tiles,
            report,
            solve_ms,
            build_ms,
            measure_ms,
            fetch_ms,
        })
    }
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
