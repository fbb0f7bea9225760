//! A window that shows how painted features keep their shape while a mesh deforms: orbit, scrub, paint what is rigid.
//!
//! `cargo run --release -p vrtm-view` opens a built-in scene; README.md shows what the window can do. The way of the
//! data: `source` (of `vrtm_examples`, for the example `bake`, too) and `gltf` read files into a `model`; `solve` turns
//! a frame of the `timeline` into an answer, on a thread of its own; `draw` shows it; `brush` changes the maps; `panel`
//! is what the user sees of all that, and `save` writes files.

mod app;
mod args;
mod brush;
mod draw;
mod gltf;
mod model;
mod numbers;
mod panel;
mod pictures;
mod save;
mod solve;
mod timeline;
mod trace;

use std::process::ExitCode;
use std::sync::Arc;

use clap::Parser;
use eframe::egui;
use eframe::egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use vrtm_examples::{failure, maps, mesh, source};

use app::App;
use args::Args;
use trace::Trace;

fn main() -> ExitCode {
    let args = Args::parse();
    let failed = |message: String| {
        eprintln!("vrtm-view: {message}");
        ExitCode::FAILURE
    };
    let trace = match Trace::new(args.trace.as_deref()) {
        Ok(trace) => trace,
        Err(message) => return failed(message),
    };
    let size = args.size;
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("vrtm")
            .with_inner_size(size)
            .with_min_inner_size([800.0, 480.0]),
        renderer: eframe::Renderer::Wgpu,
        wgpu_options: WgpuConfiguration { wgpu_setup: setup(), ..WgpuConfiguration::default() },
        ..eframe::NativeOptions::default()
    };
    let create: eframe::AppCreator<'_> =
        Box::new(move |context| Ok(Box::new(App::new(context, args, trace)?)));
    match eframe::run_native("vrtm-view", options, create) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => failed(format!("no window: {error}")),
    }
}

/// No GL, whose drivers differ too much; a software driver will do. Maps of 32-bit floats are filtered where that is
/// possible.
fn setup() -> WgpuSetup {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor.backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY);
    setup.device_descriptor = Arc::new(|adapter| wgpu::DeviceDescriptor {
        label: Some("vrtm-view"),
        required_features: adapter.features() & wgpu::Features::FLOAT32_FILTERABLE,
        required_limits: wgpu::Limits {
            max_texture_dimension_2d: adapter.limits().max_texture_dimension_2d,
            max_storage_buffer_binding_size: adapter.limits().max_storage_buffer_binding_size,
            max_buffer_size: adapter.limits().max_buffer_size,
            ..wgpu::Limits::default()
        },
        ..wgpu::DeviceDescriptor::default()
    });
    setup.into()
}
