//! `umbra watch`: checks a working folder on every save, and shows the report in the browser.
//!
//! Each check runs `umbra check` as a separate program, so that no renderer can end the watch. A new save ends the
//! running check. The page is served only on this machine, under an address that nobody can guess.

mod check;
mod live;
mod page;
mod saves;
mod server;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::channel;

use anyhow::Context as _;

use self::check::{Checker, is_judged};
use self::live::LiveView;
use self::saves::{Change, Happened, Watched, wait};
use self::server::{Board, CheckState, Server};
use super::context::{Context, on_interrupt};
use super::outputs::ensure_apart;
use super::selection::Selection;
use super::tree::ensure_working_folder;
use crate::grading::Mode;

/// Options of `umbra watch`.
#[derive(clap::Args)]
pub struct WatchArguments {
    /// Your working folder (config.json, src/, offline/, realtime/)
    folder: PathBuf,
    /// Check only this part, such as 2.3; may be repeated
    #[arg(long, value_name = "PART")]
    part: Vec<String>,
    /// Check only on this scene, such as teapot; may be repeated
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Where to write the report with its pictures
    #[arg(
        long = "report",
        alias = "output",
        short_alias = 'o',
        value_name = "DIR",
        default_value = "umbra-report"
    )]
    output: PathBuf,
}

/// Watches until Ctrl-C.
///
/// # Errors
/// When the folder cannot be watched, or the page cannot be served.
pub fn run(arguments: &WatchArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let name = || format!("cannot watch {}", arguments.folder.display());
    let folder = arguments.folder.canonicalize().with_context(name)?;
    anyhow::ensure!(folder.is_dir(), "{}: expected a folder", arguments.folder.display());
    let context = Context::new(root)?;
    ensure_working_folder(&arguments.folder, &context.assignment.tree)?;
    let given = [crate::class::Source::given(&folder)];
    let slug = super::class::sources(
        Mode::Check,
        &given,
        &arguments.output,
        &std::collections::HashMap::new(),
    )
    .remove(0)
    .slug;
    // Errors come before anything opens.
    Selection { parts: arguments.part.clone(), scenes: arguments.scene.clone() }
        .restrict(&mut Context::assignment(root)?)?;
    ensure_apart(&arguments.output, &folder, &slug, &context.assignment.tree)?;
    super::writable(&arguments.output)?;
    let output = arguments.output.canonicalize()?;
    let live = Arc::new(LiveView::new(&context.assignment, &context.supervisor, &arguments.scene)?);

    let (happened, happens) = channel();
    let interrupted = happened.clone();
    on_interrupt(move || {
        let _ = interrupted.send(Happened::Interrupted);
    })?;
    let mut watched = Watched::new(&folder, &output, happened.clone())?;
    watched.begin().with_context(name)?;

    let board = Arc::new(Board::default());
    let server = Server::start(output.join(slug), Arc::clone(&board), Arc::clone(&live))?;
    let door = server.door()?;
    println!("{}", door.path().display());
    eprintln!(
        "umbra: watching {}; open the page above in a browser. Ctrl-C ends this",
        folder.display()
    );
    super::view::open_page(&door.path());

    let check = Checker {
        folder: &folder,
        output: &output,
        arguments,
        root,
        board: &board,
        live: &live,
        happened,
    };
    let mut begun = 0;
    let mut running = Some(check.start(Change::Other, &mut begun)?);
    // Whether the last whole report tells how the offline half of the source is now.
    let mut offline_holds = false;
    loop {
        match wait(&happens, watched.is_gone()) {
            Happened::Saved(change) => {
                if !watched.follow() {
                    continue;
                }
                if let Some(older) = running.take() {
                    older.end();
                }
                if watched.is_gone() {
                    let gone =
                        format!("{} is gone; it is checked when it is back", folder.display());
                    eprintln!("umbra: {gone}");
                    board.show(CheckState::Failed, &gone);
                    continue;
                }
                offline_holds &= change == Change::Shader;
                let change = if offline_holds { Change::Shader } else { Change::Other };
                running = Some(check.start(change, &mut begun)?);
            }
            Happened::Ended(number) => {
                // An older one was ended by a save.
                if let Some(mut ended) = running.take_if(|running| running.number == number) {
                    let status = ended.child.wait()?;
                    ended.hear_out();
                    offline_holds |= is_judged(status);
                    check.show(status);
                }
            }
            Happened::Interrupted => {
                if let Some(last) = running.take() {
                    last.end();
                }
                live.end();
                return Ok(super::EXIT_OK);
            }
        }
    }
}
