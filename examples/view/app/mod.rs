//! The program: what is open, what is shown, and one pass over the window.

pub mod dialogs;
mod draw;
mod open;
mod saving;
mod stroke;

use std::path::PathBuf;
use std::sync::Arc;

use eframe::egui::{self, Align, Key, Layout, Modifiers, Panel, RichText, ScrollArea, Ui, ViewportCommand};
use eframe::egui_wgpu;
use serde_json::json;

use crate::args::Args;
use crate::brush::kind::Brush;
use crate::brush::painter::Painter;
use crate::brush::pick::Hit;
use crate::draw::beyond;
use crate::draw::camera::Orbit;
use crate::draw::gpu::Gpu;
use crate::draw::scene::Scene;
use crate::model::Model;
use crate::panel::bar::{self, Wish};
use crate::panel::figures::{self, History};
use crate::panel::settings::{self, Settings};
use crate::panel::side::section;
use crate::panel::viewport::Look;
use crate::panel::{brush, line, part, style};
use crate::pictures::Pictures;
use crate::solve::answer::Answer;
use crate::solve::flow::{Flow, Wanted};
use crate::solve::inbox::Edit;
use crate::solve::worker::{News, Worker};
use crate::solve::worst;
use crate::timeline::Timeline;
use crate::trace::Trace;
use dialogs::{Ask, Dialogs};
use draw::Screen;
use saving::Question;
use stroke::Stroke;

/// The open mesh.
pub struct Open {
    model: Arc<Model>,
    painter: Painter,
    scene: Scene,
    pictures: Pictures,
    /// The files that were read.
    inputs: Vec<PathBuf>,
    line: Timeline,
    orbit: Orbit,
    /// The last fit of the mesh to its pane, and the pane's shape: until the user moves, it follows that shape.
    framed: Option<(Orbit, f32)>,
    /// The first edit that belongs to it: earlier answers are of another mesh.
    first: u64,
}

pub struct App {
    gpu: Gpu,
    worker: Worker,
    trace: Trace,
    open: Option<Open>,
    look: Look,
    brush: Brush,
    settings: Settings,
    /// The settings that the thread has.
    told: Settings,
    flow: Flow,
    shown: Option<Answer>,
    /// Rings around its worst features, by the original UVs and through the redirection.
    rings: [Vec<(Hit, f32)>; 2],
    history: History,
    screen: Screen,
    stroke: Stroke,
    question: Option<Question>,
    dialogs: Dialogs,
    /// The dialog to show next.
    asked: Option<Ask>,
    /// The text of the field for paths.
    path: String,
    /// The folder to save to.
    folder: String,
    device: String,
    /// Frames per second.
    rate: u16,
    notice: Option<Notice>,
}

/// Text of the last line, until something else happens.
#[derive(Clone)]
struct Notice {
    text: String,
    is_error: bool,
}

impl App {
    /// # Errors
    /// If the window is not drawn with wgpu.
    pub fn new(context: &eframe::CreationContext, args: Args, trace: Trace) -> Result<App, String> {
        style::apply(&context.egui_ctx);
        let state: &egui_wgpu::RenderState =
            context.wgpu_render_state.as_ref().ok_or("wgpu draws no window here")?;
        let wake = {
            let ctx = context.egui_ctx.clone();
            move || ctx.request_repaint()
        };
        let mut app = App {
            gpu: Gpu::new(state),
            worker: Worker::new(args.device, wake),
            trace,
            open: None,
            look: Look { panes: args.view, ..Look::default() },
            brush: Brush::DEFAULT,
            settings: Settings::default(),
            told: Settings::default(),
            flow: Flow::default(),
            shown: None,
            rings: Default::default(),
            history: History::default(),
            screen: Screen::new(state.renderer.clone()),
            stroke: Stroke::default(),
            question: None,
            dialogs: Dialogs::new(),
            asked: None,
            path: String::new(),
            folder: std::env::current_dir().map_or(".".into(), |folder| folder.display().to_string()),
            device: String::new(),
            rate: args.choice.rate,
            notice: None,
        };
        app.open_part(&args.files, &args.choice);
        for (ask, pattern) in [(Ask::Texture, &args.texture), (Ask::Normal, &args.normal)] {
            if let (Some(_), Some(pattern)) = (&app.open, pattern) {
                app.open_picture(ask, pattern);
            }
        }
        if let (Some(open), Some(frame)) = (&mut app.open, args.frame) {
            open.line.go(open.line.frame_of(frame));
        }
        Ok(app)
    }

    /// Shows what went wrong.
    fn say(&mut self, message: String) {
        self.trace.event("notice", json!({ "text": message }));
        self.notice = Some(Notice { text: message, is_error: true });
    }

    /// Takes what the solving thread has done.
    fn hear(&mut self) {
        let news: Vec<News> = self.worker.news().collect();
        for news in news {
            match news {
                News::Device(text) => self.device = text,
                News::Failed(text) => self.say(text),
                News::Solved(answer) => self.show(*answer),
            }
        }
    }

    fn show(&mut self, answer: Answer) {
        let Some(open) = self.open.as_mut().filter(|open| answer.request.edit >= open.first) else { return };
        let request = &answer.request;
        let strain = answer.strain();
        self.trace.event(
            "solve",
            json!({
                "frame": request.frame, "edit": request.edit,
                "purpose": format!("{:?}", request.purpose).to_lowercase(),
                "quality": format!("{:?}", request.quality).to_lowercase(), "solve_ms": answer.solve_ms,
                "build_ms": answer.build_ms, "fetch_ms": answer.fetch_ms, "measure_ms": answer.measure_ms,
                "min_jacobian": answer.report.min_jacobian,
                "folds": answer.report.folds,
                "strain": strain.map(|s| json!({ "edges": s.edges, "rms": s.rms, "p95": s.p95 })),
            }),
        );
        self.history.learn(&answer);
        self.flow.learn(&answer, self.settings.quality);
        open.scene.show(&self.gpu, &answer);
        self.screen.changed();
        self.rings = worst::rings(&open.model, &answer);
        self.shown = Some(answer);
    }

    /// Asks for what the window should show.
    fn ask(&mut self, moving: bool) {
        let Some(open) = &self.open else { return };
        if self.settings.overlaps.layers() != self.told.overlaps.layers() {
            self.told.overlaps = self.settings.overlaps;
            let (model, line) = (open.model.clone(), open.line.clone());
            let view = (open.orbit, open.framed);
            self.open_part(&model.files, &model.choice);
            if let Some(open) = &mut self.open {
                (open.line, (open.orbit, open.framed)) = (line, view);
            }
            return;
        }
        if self.settings.tile != self.told.tile {
            self.flow.edit += 1;
            self.worker.inbox.post(Edit::Settings(self.settings.tile));
            self.notice = None;
        }
        self.told = self.settings;
        if beyond::reach(&self.settings.tile) != open.scene.reach() {
            self.draw_anew();
        }
        let Some(open) = &self.open else { return };
        let (frame, last, quality) = (open.line.frame, open.line.last, self.settings.quality);
        let wanted = Wanted { frame, last, quality, moving };
        let shown = self.shown.as_ref().map(|answer| &answer.request);
        if let Some(request) = self.flow.next(&wanted, shown) {
            self.worker.inbox.ask(request);
        }
    }

    fn bar(&mut self, ui: &mut Ui, scale: f32) {
        let (name, z_up) = self
            .open
            .as_ref()
            .map_or(("nothing open", false), |open| (open.model.name.as_str(), open.orbit.z_up));
        let App { look, path, folder, trace, .. } = self;
        let mut wish = Panel::top("bar").frame(style::frame(0)).exact_size(42.0).show(ui, |ui| {
            let fields = (&mut *look, path, folder);
            bar::show(ui, (name, z_up), fields, |name, rect| trace.widget(name, rect, scale))
        });
        if !ui.ctx().egui_wants_keyboard_input() {
            wish.inner = wish.inner.or(bar::keys(ui, look));
        }
        match (wish.inner, &mut self.open) {
            (Some(Wish::Save(pressed)), _) => self.press(pressed),
            (Some(Wish::Open(files)), _) => self.open_files(&files),
            (Some(Wish::Path(path)), _) => self.open_path(path),
            (Some(Wish::Ask(ask)), _) => self.asked = Some(ask),
            (Some(Wish::Frame(side)), Some(open)) => {
                open.framed = None;
                if let Some(side) = side {
                    open.orbit.look_from(side);
                }
            }
            (Some(Wish::Up(z_up)), Some(open)) => (open.orbit.z_up, open.framed) = (z_up, None),
            _ => {}
        }
    }

    /// Returns whether something is being dragged.
    fn side(&mut self, ui: &mut Ui, scale: f32) -> bool {
        let width = ui.ctx().content_rect().width();
        if !self.look.has_side(width) {
            return false;
        }
        let App { settings, brush, look, trace, open, history, shown, screen, .. } = self;
        let mut noted = |name: &str, rect: egui::Rect| trace.widget(name, rect, scale);
        let (mut dragged, mut wish, mut choice) = (false, None, None);
        let frame = style::frame(10);
        Panel::right("side")
            .frame(frame)
            .resizable(false)
            .exact_size(if width < 1000.0 { 320.0 } else { 348.0 })
            .show(ui, |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    if let Some(answer) = shown {
                        section(ui, "This frame", true, |ui| {
                            figures::show(ui, answer, history, screen.milliseconds)
                        });
                    }
                    if let Some(open) = open {
                        choice = part::show(ui, &open.model, &mut noted);
                    }
                    if look.brush
                        && let Some(open) = open
                    {
                        wish = section(ui, "Brush", true, |ui| {
                            let has_texture = open.pictures.have_colour();
                            brush::show(ui, brush, (&open.painter.steps, has_texture), &mut noted)
                        })
                        .flatten();
                    }
                    dragged |= section(ui, "Solve", true, |ui| settings::show(ui, settings, &mut noted))
                        .unwrap_or(false);
                });
            });
        if let Some(wish) = wish {
            self.brush_wish(wish);
        }
        if let (Some(choice), Some(open)) = (choice, &self.open) {
            let files = open.model.files.clone();
            self.open_part(&files, &choice);
        }
        dragged
    }

    /// Returns whether the timeline is being dragged.
    fn line(&mut self, ui: &mut Ui, scale: f32) -> bool {
        let App { open, trace, history, shown, device, notice, worker, .. } = self;
        let Some(open) = open else { return false };
        let now = ui.input(|i| i.time);
        let keys = !ui.ctx().egui_wants_keyboard_input();
        let pressed = |key| keys && ui.input(|i| i.key_pressed(key));
        if pressed(Key::Space) {
            open.line.toggle(now);
        }
        for (key, way) in [(Key::ArrowLeft, -1), (Key::ArrowRight, 1)] {
            if pressed(key) {
                open.line.go(open.line.frame.saturating_add_signed(way).max(1));
            }
        }
        for (key, forward) in [(Key::PageUp, false), (Key::PageDown, true)] {
            if pressed(key) {
                open.line.step_to_key(forward);
            }
        }
        open.line.tick(now);
        let mut dragged = false;
        Panel::bottom("status").frame(style::frame(4)).exact_size(24.0).show(ui, |ui| {
            ui.horizontal_centered(|ui| {
                let busy = worker.inbox.is_busy();
                let wanted = open.line.frame;
                let state = match shown {
                    Some(answer) if answer.request.frame == wanted && !busy => "up to date",
                    _ => "solving",
                };
                ui.label(RichText::new(state).small().color(style::QUIET));
                if let Some(Notice { text, is_error }) = notice.clone() {
                    if ui.small_button("×").clicked() {
                        *notice = None;
                    }
                    let colour = if is_error { style::ERROR } else { style::TEXT };
                    // What does not fit is told under the mouse.
                    ui.add(egui::Label::new(RichText::new(text).small().color(colour)).truncate());
                    return;
                }
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    ui.add(egui::Label::new(RichText::new(&*device).small().color(style::QUIET)).truncate());
                });
            });
        });
        // A low window has no room for the plot.
        let plots = ui.ctx().content_rect().height() >= 560.0;
        let height = if plots { 92.0 } else { 58.0 };
        Panel::bottom("timeline").frame(style::frame(8)).exact_size(height).show(ui, |ui| {
            let noted = |name: &str, rect| trace.widget(name, rect, scale);
            dragged = line::show(ui, &mut open.line, (&open.model, plots.then_some(history)), now, noted);
        });
        dragged
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, frame: &mut eframe::Frame) {
        let scale = ui.ctx().pixels_per_point();
        self.trace.begin_frame(ui.ctx());
        self.hear();
        if ui.input_mut(|i| i.consume_key(Modifiers::COMMAND, Key::Q)) {
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
        }
        self.open_dropped(ui);
        self.bar(ui, scale);
        let mut moving = self.side(ui, scale);
        moving |= self.line(ui, scale);
        moving |= self.viewport(ui, scale);
        if self.open.as_ref().is_some_and(|open| open.line.is_playing()) {
            moving = true;
            ui.ctx().request_repaint();
        }
        self.ask(moving);
        self.ask_question(ui, scale);
        self.dialog(ui, frame);
        self.trace.end_frame(ui.ctx());
    }

    fn on_exit(&mut self) {
        self.trace.event("close", json!({}));
    }
}
