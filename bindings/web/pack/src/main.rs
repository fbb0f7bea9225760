//! Makes a JavaScript module, with its types, of the library for WebAssembly: `pack INPUT.wasm FOLDER`. A program of this
//! workspace, so that Cargo.lock gives it the version of the library's own `wasm-bindgen`.

use std::process::ExitCode;

use wasm_bindgen_cli_support::Bindgen;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, folder] = arguments.as_slice() else {
        eprintln!("usage: pack INPUT.wasm FOLDER");
        return ExitCode::from(2);
    };
    let made = Bindgen::new()
        .input_path(input)
        .web(true)
        .and_then(|bindgen| bindgen.out_name("vrtm").typescript(true).generate(folder));
    match made {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("pack: {error:#}");
            ExitCode::FAILURE
        }
    }
}
