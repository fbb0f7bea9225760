//! The picture of the mesh in the window.

use std::sync::Arc;
use std::time::Instant;

use eframe::egui::mutex::RwLock;
use eframe::egui::{CentralPanel, Color32, Frame, Id, Pos2, Rect, TextureId, Ui, pos2};
use eframe::egui_wgpu::Renderer;
use serde_json::json;

use super::App;
use crate::brush::pick::Hit;
use crate::draw::camera::View;
use crate::draw::picture::Picture;
use crate::panel::style;
use crate::panel::viewport::{self, Shown};

/// Seconds in which the map over textures comes and goes with the brush.
const FADE: f32 = 0.6;

/// The picture on the screen, drawn again only if something changed.
pub struct Screen {
    renderer: Arc<RwLock<Renderer>>,
    picture: Option<(Picture, TextureId)>,
    /// Content of the picture.
    views: Vec<View>,
    wipe: Option<f32>,
    fresh: bool,
    /// Duration.
    pub milliseconds: f64,
}

impl Screen {
    pub fn new(renderer: Arc<RwLock<Renderer>>) -> Screen {
        Screen { renderer, picture: None, views: Vec::new(), wipe: None, fresh: false, milliseconds: 0.0 }
    }

    /// Tells that the mesh or its maps changed.
    pub fn changed(&mut self) {
        self.fresh = false;
    }

    pub fn size(&self) -> [u32; 2] {
        self.picture.as_ref().map_or([640, 480], |(picture, _)| picture.size)
    }

    pub fn views(&self) -> (&[View], Option<f32>) {
        (&self.views, self.wipe)
    }
}

impl App {
    /// The view of the mesh. Returns whether the user paints.
    pub(super) fn viewport(&mut self, ui: &mut Ui, scale: f32) -> bool {
        let back = Frame::NONE.fill(style::BACK);
        CentralPanel::default().frame(back).show(ui, |ui| self.viewport_in(ui, scale)).inner
    }

    fn viewport_in(&mut self, ui: &mut Ui, scale: f32) -> bool {
        let Some(open) = &mut self.open else {
            let text =
                self.notice.as_ref().map_or("Drop an asset folder or OBJ files here", |notice| &notice.text);
            ui.centered_and_justified(|ui| ui.label(text));
            return false;
        };
        let (area, mouse) = viewport::mouse(ui, &mut self.look, &mut open.orbit);
        self.trace.widget("view", area, scale);
        let pane = self.look.pane(area, 0);
        let aspect = pane.width() / pane.height();
        if open.framed.is_none_or(|(orbit, of)| orbit == open.orbit && of != aspect) {
            open.orbit.frame(open.model.sample().iter(), aspect);
            open.framed = Some((open.orbit, aspect));
        }
        let camera = open.orbit.camera(aspect);
        self.brush_keys(ui);
        let painting = self.paint(ui, pane.size(), &camera, &mouse);
        let cells = self
            .shown
            .as_ref()
            .and_then(|answer| answer.tiles.iter().map(|tile| tile.report.grid[0]).max())
            .filter(|&cells| cells > 0)
            .unwrap_or(512);
        let overlay = ui.ctx().animate_bool_with_time(Id::unique("overlay"), self.look.brush, FADE);
        let has_colour = self.open.as_ref().is_some_and(|open| open.pictures.have_colour());
        let views = self.look.views(&camera, cells, scale, if has_colour { overlay } else { 0.0 });
        let pixels = [area.width(), area.height()].map(|x| (x * scale).round().max(1.0) as u32);
        self.redraw(views, pixels);
        if let Some((_, id)) = &self.screen.picture {
            let whole = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
            ui.painter().image(*id, area, whole, Color32::WHITE);
        }
        let has_strain = self.shown.is_some();
        viewport::overlay(ui, area, &self.look, has_strain);
        if let (Shown::Strain, Some(open), Some(answer)) = (self.look.shown, &self.open, &self.shown) {
            for (pane, &redirected) in self.look.redirected().iter().enumerate() {
                let places = (self.look.pane(area, pane), self.look.seen(area, pane));
                let is_seen = |hit: &Hit| hit.shows(&open.model, &answer.positions, &camera);
                let rings = self.rings[usize::from(redirected)].iter().filter(|(hit, _)| is_seen(hit));
                rings.for_each(|(hit, radius)| viewport::outline(ui, places, &camera, hit, *radius));
            }
        }
        if let Some((pane, hit, radius)) = self.stroke.under.filter(|_| self.look.brush) {
            let places = (self.look.pane(area, pane), self.look.seen(area, pane));
            viewport::outline(ui, places, &camera, &hit, radius);
        }
        painting
    }

    /// Draws the picture again if it changed.
    fn redraw(&mut self, views: Vec<View>, pixels: [u32; 2]) {
        let screen = &mut self.screen;
        if screen.picture.as_ref().is_none_or(|(picture, _)| picture.size != pixels) {
            let picture = Picture::new(&self.gpu, pixels);
            let view = picture.texture.create_view(&Default::default());
            let mut renderer = screen.renderer.write();
            let nearest = wgpu::FilterMode::Nearest;
            let id = match &screen.picture {
                Some((_, id)) => {
                    renderer.update_egui_texture_from_wgpu_texture(&self.gpu.device, &view, nearest, *id);
                    *id
                }
                None => renderer.register_native_texture(&self.gpu.device, &view, nearest),
            };
            screen.picture = Some((picture, id));
            screen.fresh = false;
        }
        let wipe = self.look.line();
        if screen.fresh && screen.views == views && screen.wipe == wipe {
            return;
        }
        let start = Instant::now();
        let Some((picture, _)) = &screen.picture else { return };
        picture.draw(&self.gpu, self.open.as_ref().map(|open| &open.scene), &views, wipe);
        // Waiting makes the time honest; a lost GPU is told by the window's own drawing.
        let _ = self.gpu.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None });
        screen.milliseconds = start.elapsed().as_secs_f64() * 1e3;
        (screen.views, screen.wipe, screen.fresh) = (views, wipe, true);
        if let Some(answer) = &self.shown {
            let request = &answer.request;
            let facts = json!({
                "frame": request.frame, "edit": request.edit, "ms": self.screen.milliseconds,
                "purpose": format!("{:?}", request.purpose).to_lowercase(),
                "quality": format!("{:?}", request.quality).to_lowercase(),
                "panes": self.look.redirected(), "shown": format!("{:?}", self.look.shown).to_lowercase(),
                "overlay": self.screen.views.first().map(|view| view.overlay),
            });
            self.trace.once_seen("drawn", facts);
        }
    }
}
