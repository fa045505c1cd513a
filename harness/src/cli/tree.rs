//! `umbra validate` and `umbra pack`: a submission's tree, without running anything of it.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use std::sync::atomic::Ordering;

use anyhow::{Context as _, bail, ensure};
use unicode_width::UnicodeWidthStr as _;

use super::context::{Context, INTERRUPTED};
use super::outputs::{ensure_outside, place_inside};
use crate::class::collect::Ambiguous;
use crate::class::{CollectOptions, Collected, Platform, collect};
use crate::columns::count;
use crate::harmless::{harmless, harmless_json};
use crate::intake::{self, CONFIG_FILE, IntakeError, Severity, Submission, TreeSpec, Validation};

/// Files that `--fix` leaves out and names.
const LEFT_OUT: usize = 40;

/// Options of `umbra validate`.
#[derive(clap::Args)]
pub struct ValidateArguments {
    /// Archives, folders or downloads, as for `umbra grade`
    #[arg(required = true)]
    submissions: Vec<PathBuf>,
    /// Where the submissions come from [default: recognized by their names]
    #[arg(long, value_enum, value_name = "KIND")]
    from: Option<Platform>,
    /// Print the findings as JSON: a list with one entry for each submission
    #[arg(long, conflicts_with = "fix")]
    json: bool,
    /// Repack a nearly conforming submission (wrong level, other names, junk) into a new archive
    #[arg(long, value_name = "OUT.zip")]
    fix: Option<PathBuf>,
}

/// Options of `umbra pack`.
#[derive(clap::Args)]
pub struct PackArguments {
    /// The working folder: config.json, src/, offline/, realtime/
    folder: PathBuf,
    /// Where to write the archive: a file, or a folder other than the working folder [default: the current folder, or
    /// the one above where that is the working folder]
    #[arg(long, short, value_name = "OUT")]
    output: Option<PathBuf>,
}

/// Prints the expected tree beside the found one, or a table of many submissions; exit 0 when all conform, 1 when not.
///
/// # Errors
/// When a path does not exist, or an archive cannot be decoded or written.
pub fn validate(arguments: &ValidateArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let context = Context::new(root)?;
    for path in &arguments.submissions {
        // A link that leads nowhere is there, and refused.
        ensure!(path.symlink_metadata().is_ok(), "{} does not exist", path.display());
    }
    if let Some(out) = &arguments.fix {
        ensure_new_archive(out, &arguments.submissions)?;
    }
    let scratch = tempfile::tempdir_in(&context.supervisor.scratch)?;
    let found = match &arguments.submissions[..] {
        // A folder that holds none is one itself, of which much is missing; a link is refused.
        [only] if only.is_symlink() => None,
        paths => {
            let wanted = CollectOptions {
                tree: &context.assignment.tree,
                limits: &context.assignment.limits.archive,
                from: arguments.from,
                output: None,
                scratch: scratch.path(),
            };
            match collect(paths, &wanted) {
                Ok(found) => Some(found),
                Err(error)
                    if paths.len() > 1 || arguments.from.is_some() || error.is::<Ambiguous>() =>
                {
                    return Err(error);
                }
                Err(_) => None,
            }
        }
    };
    let Some(found) = found else { return one(arguments, &arguments.submissions[0], &context) };
    match &found.sources[..] {
        [only] if !arguments.json && only.path == arguments.submissions[0] => {
            one(arguments, &only.path, &context)
        }
        // The only one in a download or folder.
        [only] if arguments.fix.is_some() => one(arguments, &only.path, &context),
        _ => many(arguments, &found, &context),
    }
}

/// Refuses to write an archive over what is there, into a submission, or under a name that says something else.
fn ensure_new_archive(out: &Path, submissions: &[PathBuf]) -> anyhow::Result<()> {
    let shown = out.display();
    ensure!(
        out.symlink_metadata().is_err(),
        "{shown} is there already; hint: name a new file, --fix overwrites nothing"
    );
    let is_zip = out.extension().is_some_and(|end| end.eq_ignore_ascii_case("zip"));
    ensure!(is_zip, "{shown}: --fix writes a zip, expected a name that ends in .zip");
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    folder.canonicalize().with_context(|| {
        format!("cannot write {shown}: there is no folder {}", folder.display())
    })?;
    submissions.iter().try_for_each(|submission| ensure_outside(out, submission))
}

/// Of one submission, its tree.
fn one(arguments: &ValidateArguments, archive: &Path, context: &Context) -> anyhow::Result<u8> {
    let (tree, limits) = (&context.assignment.tree, &context.assignment.limits.archive);
    let private = tempfile::tempdir_in(&context.supervisor.scratch)?;
    let (validation, submission) = look(archive, &private.path().join("copy"), context)?;
    if arguments.json {
        println!("{}", harmless_json(&[&validation])?);
        return Ok(if validation.conforms { super::EXIT_OK } else { super::EXIT_NOT_IN_ORDER });
    }
    print!("{}", validation.to_text());
    if let Some(out) = &arguments.fix {
        let packed = intake::fix(&submission?, out, tree, limits)?;
        for (from, to) in packed.files.iter().filter(|(from, to)| from != to) {
            println!("moved {from} to {to}");
        }
        for path in packed.left_out.iter().take(LEFT_OUT) {
            println!("left out {path}");
        }
        if packed.left_out.len() > LEFT_OUT {
            println!("left out {} more", packed.left_out.len() - LEFT_OUT);
        }
        println!("repacked as {}", packed.archive.display());
    }
    Ok(if validation.conforms { super::EXIT_OK } else { super::EXIT_NOT_IN_ORDER })
}

/// Of many submissions, a line each.
fn many(arguments: &ValidateArguments, found: &Collected, context: &Context) -> anyhow::Result<u8> {
    ensure!(
        arguments.fix.is_none(),
        "--fix repacks one submission, found {}; hint: name one of them",
        found.sources.len()
    );
    let mut validations = Vec::new();
    for source in &found.sources {
        context.say(&format!("reading {}", source.name));
        let private = tempfile::tempdir_in(&context.supervisor.scratch)?;
        let (validation, _) = look(&source.path, &private.path().join("copy"), context)?;
        validations.push(Validation { name: source.name.clone(), ..validation });
        if INTERRUPTED.load(Ordering::Relaxed) {
            return Ok(super::EXIT_INTERRUPTED);
        }
    }
    context.progress.end();
    let wrong = validations.iter().filter(|validation| !validation.conforms).count();
    if arguments.json {
        println!("{}", harmless_json(&validations)?);
    } else {
        let name = |validation: &Validation| harmless(&validation.name);
        let wide = validations.iter().map(|own| name(own).width()).max().unwrap_or_default();
        for validation in &validations {
            let name = name(validation);
            let gap = " ".repeat(wide - name.width());
            println!("{name}{gap}  {}", harmless(&in_a_line(validation)));
        }
        println!();
        if let Some(recognized) = found.recognized() {
            println!("{recognized}");
        }
        let all = validations.len();
        println!("{}: {} conforming, {wrong} not", count(all, "submission"), all - wrong);
        for line in &found.unopened {
            println!("neither opened nor graded: {}", harmless(line));
        }
        if !found.copies.is_empty() {
            let copies = harmless(&found.copies.join(", "));
            println!("in more than one download with the same content, read once: {copies}");
        }
        for empty in &found.empty {
            println!("{}: {}", harmless(&empty.label.who()), harmless(&empty.reason()));
        }
        if let Some(skipped) = found.skipped() {
            println!("skipped, not submissions: {skipped}");
        }
    }
    let in_order = wrong == 0 && found.empty.is_empty() && found.unopened.is_empty();
    Ok(if in_order { super::EXIT_OK } else { super::EXIT_NOT_IN_ORDER })
}

/// `conforms, 2 warnings`, or the first error.
fn in_a_line(validation: &Validation) -> String {
    let of =
        |severity| validation.findings.iter().filter(move |finding| finding.severity == severity);
    let plural = |number: usize, what: &str| match number {
        0 => String::new(),
        _ => format!(", {}", count(number, what)),
    };
    let warnings = plural(of(Severity::Warning).count(), "warning");
    match of(Severity::Error).next() {
        None => format!("conforms{warnings}"),
        Some(first) => {
            let more = plural(of(Severity::Error).count() - 1, "more error");
            format!("{first}{more}{warnings}")
        }
    }
}

/// What there is to say of a submission, and its copy in the new folder `copy` unless it is refused.
fn look(
    archive: &Path,
    copy: &Path,
    context: &Context,
) -> anyhow::Result<(Validation, Result<Submission, IntakeError>)> {
    let (tree, limits) = (&context.assignment.tree, &context.assignment.limits.archive);
    std::fs::create_dir(copy)?;
    let decoder = context.decoder();
    match decoder.receive(archive, copy, tree, limits) {
        Ok(received) => {
            let film = |image: &str| context.assignment.film_of(image);
            let images = decoder.image_findings(&received.submission, tree, &film)?;
            Ok((received.validation.with(images), Ok(received.submission)))
        }
        Err(IntakeError::Refused(refusal)) => {
            Ok((intake::validate_refusal(&refusal), Err(IntakeError::Refused(refusal))))
        }
        Err(IntakeError::Io { source, .. }) if source.kind() == ErrorKind::Other => {
            Err(super::MachineLacks(format!("{}: {source}", archive.display())).into())
        }
        Err(error) => bail!(error),
    }
}

/// Depth of the search for a working folder, in folders.
const MAX_DEPTH: usize = 3;
/// Number of folders that are searched for one.
const MAX_FOLDERS: usize = 2000;

/// The working folder that is meant: the one that is named, or the only one below it.
fn working_folder(named: &Path, tree: &TreeSpec) -> anyhow::Result<PathBuf> {
    let has_part = named.join(CONFIG_FILE).is_file();
    match &working_folders_in(named, tree)[..] {
        [only] => Ok(only.clone()),
        // What is missing of it is told then.
        [] if has_part => Ok(named.to_owned()),
        [] => bail!("it holds neither {CONFIG_FILE} nor src/, expected your working folder"),
        several => bail!(several_folders(named, several)),
    }
}

/// That a folder is none to check, if working folders lie in it instead.
///
/// # Errors
/// Then; names them.
pub(super) fn ensure_working_folder(named: &Path, tree: &TreeSpec) -> anyhow::Result<()> {
    if named.join(CONFIG_FILE).is_file() {
        return Ok(());
    }
    let folder = named.display();
    match &working_folders_in(named, tree)[..] {
        [only] if only != named => {
            let inside = named.join(only.strip_prefix(named).unwrap_or(only));
            bail!(
                "{folder}: it holds neither {CONFIG_FILE} nor src/; did you mean {}?",
                inside.display()
            )
        }
        [] | [_] => Ok(()),
        several => bail!("{folder}: {}", several_folders(named, several)),
    }
}

fn several_folders(named: &Path, found: &[PathBuf]) -> String {
    let name = |path: &Path| path.strip_prefix(named).unwrap_or(path).display().to_string();
    format!(
        "it holds {} working folders, {} and {} among them; hint: name one of them",
        found.len(),
        name(&found[0]),
        name(&found[1])
    )
}

/// The folder itself if it has source, else the folders below it that have, and a configuration.
fn working_folders_in(named: &Path, tree: &TreeSpec) -> Vec<PathBuf> {
    let has_source = |folder: &Path| tree.open_folders.iter().any(|own| folder.join(own).is_dir());
    if has_source(named) {
        return vec![named.to_owned()];
    }
    let (mut found, mut seen) = (Vec::new(), 0);
    let mut open = vec![(named.to_owned(), 0)];
    while let Some((folder, depth)) = open.pop() {
        seen += 1;
        for entry in folder.read_dir().into_iter().flatten().flatten() {
            let path = entry.path();
            let name = entry.file_name().to_string_lossy().into_owned();
            let is_wanted = !name.starts_with('.') && tree.ignored_by(&name).is_none();
            if !is_wanted || !entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                continue;
            }
            if path.join(CONFIG_FILE).is_file() && has_source(&path) {
                found.push(path);
            } else if depth + 1 < MAX_DEPTH && seen + open.len() < MAX_FOLDERS {
                open.push((path, depth + 1));
            }
        }
    }
    found.sort();
    found
}

/// Writes a conforming archive; exit 1 when the folder lacks something.
///
/// # Errors
/// When it is no working folder, or the archive cannot be written.
pub fn pack(arguments: &PackArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let context = Context::new(root)?;
    let (tree, limits) = (&context.assignment.tree, &context.assignment.limits.archive);
    let folder = arguments.folder.display();
    ensure!(arguments.folder.exists(), "{folder} does not exist");
    ensure!(arguments.folder.is_dir(), "{folder} is a file, expected your working folder");
    // A link of one's own may be followed.
    let named = arguments.folder.canonicalize().with_context(|| folder.to_string())?;
    let source = working_folder(&named, tree).with_context(|| folder.to_string())?;
    if let Ok(inside) = source.strip_prefix(&named)
        && !inside.as_os_str().is_empty()
    {
        eprintln!("umbra: packing {}", arguments.folder.join(inside).display());
    }
    let beside = || named.parent().unwrap_or(Path::new(".")).to_owned();
    let out = match &arguments.output {
        Some(out) => out.clone(),
        // Whoever stands in the working folder has the archive beside it.
        None if place_inside(Path::new("."), &named).is_some() => beside(),
        None => PathBuf::from("."),
    };
    ensure_outside(&out, &arguments.folder)?;
    let out = &out;
    match intake::pack(&source, out, tree, limits) {
        Ok(packed) => {
            // As whoever grades it will see it.
            let private = tempfile::tempdir_in(&context.supervisor.scratch)?;
            let decoder = context.decoder();
            let received = decoder.receive(&packed.archive, private.path(), tree, limits)?;
            let film = |image: &str| context.assignment.film_of(image);
            let images = decoder.image_findings(&received.submission, tree, &film)?;
            let validation = received.validation.with(images);
            for finding in validation.findings.iter().filter(|f| f.severity != Severity::Note) {
                eprintln!("umbra: {finding}");
            }
            println!("{}", packed.archive.display());
            Ok(super::EXIT_OK)
        }
        Err(IntakeError::Refused(refusal)) => {
            print!("{}", intake::validate_refusal(&refusal).to_text());
            Ok(super::EXIT_NOT_IN_ORDER)
        }
        Err(error) => bail!(error),
    }
}
