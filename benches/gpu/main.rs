//! Measures the time of solves on a GPU: see `benches/gpu.sh`.

#![allow(missing_docs)]

mod ceiling;
mod parity;
mod table;
mod warm;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use vrtm::{Backend, Device, DeviceSettings};
use vrtm_testkit::{Model, assets, bench, scenes};

/// Measures the GPU backend: time and error, and each stage compared with its lower bound.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Cells on a side of the fully active grids.
    #[arg(long, value_delimiter = ',', default_values_t = [512, 1024, 2048, 4096])]
    sizes: Vec<u32>,
    /// Cells on a side of the asset's grids.
    #[arg(long, default_value_t = 2048)]
    asset_size: u32,
    /// Solves per row, after two seconds of load; the median is printed.
    #[arg(long, default_value_t = 8)]
    solves: usize,
    /// Number of the adapter.
    #[arg(long, default_value_t = 0)]
    adapter: u32,
    /// Measure even on a software driver.
    #[arg(long)]
    software: bool,
    /// Folder for the tables.
    #[arg(long, default_value = "benches/results")]
    out: PathBuf,
    /// Passed by `cargo bench`; ignored.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    bench::main(|| run(&Args::parse()))
}

fn run(args: &Args) -> Result<(), String> {
    let adapters = vrtm::adapters();
    let adapter = adapters.get(args.adapter as usize).ok_or("there is no such GPU adapter here")?;
    if adapter.software && !args.software {
        return Err(format!("{} is a software driver: --software measures it all the same", adapter.name));
    }
    let settings =
        DeviceSettings { backend: Backend::Gpu, adapter: args.adapter, ..DeviceSettings::default() };
    let device = Device::new(&settings).map_err(|error| error.to_string())?;
    let mut text = String::new();
    let mut say = |part: String| {
        print!("{part}");
        text += &part;
    };
    say(format!("# {}\n\n", device.info().name));
    if adapter.software {
        say("A software driver: the figures below show that the bench runs, not how fast a GPU is.\n\n"
            .into());
    }
    let ceiling = ceiling::bytes_per_second(args.adapter as usize)?;
    say(format!(
        "Bandwidth ceiling (copy of buffers, read and written bytes): {:.0} GB/s\n\n",
        ceiling * 1e-9
    ));
    say(parity::table(&device)?);
    say(table::head());
    for &size in &args.sizes {
        let bulge = Model::from(scenes::analytic::bulge());
        table::rows(&device, &bulge, 1, size, args.solves, &mut say)?;
    }
    for (name, frame) in [("mh_face", 1), ("ict_inner", 2)] {
        match assets().into_iter().find(|model| model.name == name) {
            Some(model) => table::rows(&device, &model, frame, args.asset_size, args.solves, &mut say)?,
            None => say(format!("| {name} | not there | | | | | | | | | | | | |\n")),
        }
    }
    for &size in args.sizes.iter().filter(|&&size| size <= 2048) {
        say(table::kernels(&device, size, args.solves, ceiling)?);
    }
    let path = args.out.join(format!("gpu-{}.md", bench::in_file_name(&device.info().name)));
    bench::write(&path, &text)?;
    println!("\nwritten to {}", path.display());
    Ok(())
}
