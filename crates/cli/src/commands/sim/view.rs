//! `spf sim view`: interactive view of a scene in a browser.

use std::net::SocketAddr;
use std::sync::Arc;

use spf_scene::Scene;
use spf_web::view::{InitialView, Library, ViewError, Viewer};

use super::{conditions, parse_kind};
use crate::args::View;
use crate::commands::{load_scene, parse_pose};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Serves the page until Ctrl-C.
pub(super) fn view(args: &View, printer: &Printer) -> Result<Exit, CliError> {
    let address: SocketAddr = args.listen.parse().map_err(|_| {
        CliError::usage(format!("--listen: expected an address and a port, found `{}`", args.listen))
            .hint("for example --listen 127.0.0.1:8000; port 0 picks a free one")
    })?;
    let pose = args.pose.as_deref().map(parse_pose).transpose().map_err(|expected| {
        CliError::usage(format!("--pose: expected {expected}, found `{}`", args.pose.as_deref().unwrap_or_default()))
            .hint("for example --pose 0,0,3,90,-10: the origin, 3 m up, looking east and 10 degrees down")
    })?;
    let craft = args.drone_model.as_deref().map(parse_kind).transpose()?;
    let conditions = conditions(&args.conditions)?;
    // The port first: without it, there is no point in loading a scene.
    let viewer = Viewer::bind(address).map_err(|error| {
        CliError::usage("cannot serve the page").because(&error).hint("--listen 127.0.0.1:0 picks a free port")
    })?;
    let loaded = Arc::new(load_scene(&args.scene, &conditions)?);
    let stopper = viewer.stopper();
    ctrlc::set_handler(move || stopper.stop()).map_err(|error| CliError::internal("cannot listen for Ctrl-C").because(&error))?;
    let address = viewer.address();
    printer.result(&format!("http://{address}/"));
    printer.log(&format!("Open this address in a browser to explore {}. Stop with Ctrl-C.", loaded.scene.name));
    if !address.ip().is_loopback() {
        printer.log("warning: anyone who can reach this address can open the view and use CPU time");
    }
    let library = Library::new(Scene::built_in().into_iter().map(str::to_owned), &args.scene, conditions, loaded);
    let beginning = InitialView { scene: args.scene.clone(), conditions, craft, pose };
    viewer.serve(library, beginning).map_err(|error: ViewError| CliError::internal("the page server failed").because(&error))?;
    Ok(Exit::Success)
}
