//! The thread that solves. It owns the asset; the window never waits for it.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Instant;

use vrtm::{
    Asset, Backend, Device, DeviceSettings, ErrorKind, ImageLayout, ImageView, PixelFormat, SolveOptions,
    SolveRequest, Strided, TileSettings,
};

use super::answer::{Answer, Maps, Solved};
use super::inbox::{Edit, Inbox, Purpose, Request, Work};
use crate::brush::canvas::Canvas;
use crate::mesh::normals;
use crate::model::{Model, Tile, mesh_source};
use vrtm_testkit::scenes::path::Path;

/// Messages of the thread.
pub enum News {
    /// The device's name, and why it was chosen.
    Device(String),
    Solved(Box<Answer>),
    /// The error.
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

    /// Messages to deliver, the oldest first.
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
                Edit::Paint { page, rect, texels } => open.as_mut().map_or(Ok(()), |open| {
                    open.canvases[page].paste(rect, &texels);
                    open.paint(page, Some(rect))
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
    /// Duration of the last measurement of strain.
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
        let asset = Asset::new(device, &mesh_source(&model.mesh, &model.rest, model.layers))?;
        // The layers of a page follow one another.
        let place = |tile: &Tile| Some(asset.find_tile(model.pages[tile.page].udim)? + tile.layer as usize);
        let tiles = model.tiles.iter().map(place).collect();
        let maps = model.tiles.iter().map(|_| Arc::new(Maps::identity())).collect();
        let mut open = Open { model, asset, tiles, canvases, maps, measure_ms: f64::MAX };
        for page in 0..open.model.pages.len() {
            open.paint(page, None)?;
            let mask = open.model.pages[page].mask.clone();
            let Some((place, mask)) = open.place_of(page).zip(mask) else { continue };
            let layout = ImageLayout::packed(mask.size[0], mask.size[1], mask.format);
            open.asset.tile_mut(place).set_mask(Some(ImageView::new("mask", &mask.bytes, layout)?))?;
        }
        open.set(settings)?;
        Ok(open)
    }

    fn set(&mut self, settings: &TileSettings) -> vrtm::Result<()> {
        self.tiles.iter().flatten().try_for_each(|&tile| self.asset.tile_mut(tile).set_settings(settings))
    }

    /// The asset's tile that stands for all layers of a page.
    fn place_of(&self, page: usize) -> Option<usize> {
        let mut tiles = self.model.tiles.iter().zip(&self.tiles);
        *tiles.find(|(tile, _)| tile.page == page)?.1
    }

    /// Hands a page's map over, or the part of it that a stroke changed.
    fn paint(&mut self, page: usize, part: Option<crate::brush::canvas::Rect>) -> vrtm::Result<()> {
        let Some(place) = self.place_of(page) else { return Ok(()) };
        let Canvas { size, texels, .. } = &self.canvases[page];
        let layout = ImageLayout::packed(size[0], size[1], PixelFormat::U16);
        let view = ImageView::new("rigidity", bytemuck::cast_slice(texels), layout)?;
        match part {
            Some(rect) => self.asset.tile_mut(place).update_rigidity(view, rect.first, rect.size),
            None => self.asset.tile_mut(place).set_rigidity(Some(view)),
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
            self.asset.tile_mut(tile).info()?;
        }
        let build_ms = milliseconds(start);
        let options = SolveOptions {
            quality: request.quality,
            // Previews only where it takes no time that anybody notices.
            measure: request.purpose != Purpose::Preview || self.measure_ms < CHEAP,
            ..SolveOptions::default()
        };
        let solve = SolveRequest {
            positions: Strided::from_slice(&pose),
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
                Some(tile) => self.asset.tile(*tile).report()?,
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
        let normals = Arc::new(normals(&self.model.triangles, &pose));
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

#[cfg(test)]
mod tests {
    use vrtm::Quality;

    use super::*;
    use crate::gltf::Choice;
    use crate::source::Files;

    /// Two sheets that lie over one another in the UV plane, of which one is stretched: by itself it is solved as if
    /// alone, and the other one stays.
    #[test]
    fn layers_are_solved_each_by_itself() {
        let folder = std::env::temp_dir().join(format!("vrtm-view-layers-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let write = |name: &str, stretch: f64| {
            let mut text = String::from("vt 0.02 0.02\nvt 0.98 0.02\nvt 0.98 0.98\nvt 0.02 0.98\n");
            for (z, x) in [(0, 1.0), (1, stretch)] {
                text += &format!("v 0 0 {z}\nv {x} 0 {z}\nv {x} 1 {z}\nv 0 1 {z}\nf -4/1 -3/2 -2/3 -1/4\n");
            }
            std::fs::write(folder.join(name), text).expect("written");
            folder.join(name)
        };
        let files = Files {
            rest: Some(write("rest.obj", 1.0)),
            pose: vec![write("wide.obj", 1.6)],
            ..Files::default()
        };
        let strain = |layers: u32| {
            let model = Arc::new(Model::layered(&files, &Choice::default(), layers).expect("a mesh"));
            let side = 64;
            let rigid = |k: i32| (k % side - 32).pow(2) + (k / side - 32).pow(2) < 64;
            let texels = (0..side * side).map(|k| if rigid(k) { 65535 } else { 0 }).collect();
            let canvas = Canvas { size: [side as u32; 2], texels, deep: false };
            let worker = Worker::new(Backend::Cpu, || {});
            worker.inbox.post(Edit::Open(model.clone(), vec![canvas]));
            let last = model.timeline.last;
            let (quality, purpose) = (Quality::Normal, Purpose::Final);
            worker.inbox.ask(Request { frame: last, last, quality, purpose, edit: 0 });
            loop {
                match worker.news.recv().expect("the thread lives") {
                    News::Solved(answer) => {
                        let of = |solved: &Solved| {
                            let strain = solved.report.strain.as_ref().filter(|s| s.segments > 0);
                            strain.map(|s| s.after.rms)
                        };
                        return answer.tiles.iter().map(of).collect::<Vec<_>>();
                    }
                    News::Failed(text) => panic!("{text}"),
                    News::Device(_) => {}
                }
            }
        };
        let together = strain(0);
        assert_eq!(together.len(), 1);
        let apart: Vec<f32> = strain(crate::model::LAYERS).into_iter().flatten().collect();
        assert_eq!(apart.len(), 2);
        assert!(apart.iter().all(|&strain| strain < 0.05), "{apart:?}");
        assert!(together[0].is_none_or(|strain| strain > 0.2), "{together:?}");
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}
