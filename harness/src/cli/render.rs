//! `umbra render`: one image of one scene by one plugin.

mod output;
mod range;

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use basecode::Camera;
use basecode::exr_io::{MAX_PIXELS, MAX_SIDE};
use basecode::scene::SceneConfig;

use self::output::{ImageFormat, kind_of};
use super::context::{Context, INTERRUPTED, cores};
use super::outputs::ensure_not_read;
use crate::files::library_name;
use crate::intake::SubmittedConfig;
use crate::process::ProcessLimits;
use crate::worker::{
    Adapter, AdapterKind, CameraValue, Fault, Job, JobReport, Outcome, Request, SceneRef, as_given,
    draw_in_process,
};

/// Options of `umbra render`.
#[derive(clap::Args)]
pub struct RenderArguments {
    /// The scene's TOML file
    scene: PathBuf,
    /// The renderer: `reference`, or the path of a plugin's library
    #[arg(long, value_name = "reference|PATH")]
    plugin: String,
    /// Where to write the image: `.exr` holds linear radiance; `.png` is clamped to [0, 1] and encoded
    /// as sRGB, for viewing
    #[arg(long, short, value_name = "OUT.exr|OUT.png")]
    output: PathBuf,
    /// Samples per pixel, offline [default: the scene's]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: Option<u32>,
    /// Seed of the samplers [default: the student number in the config.json of the submission that the
    /// image is written into, else 0]
    #[arg(long)]
    seed: Option<u64>,
    /// Threads to render with [default: all cores]
    #[arg(long)]
    threads: Option<u32>,
    /// Whether to draw shadows [default: offline on, realtime as the scene's `bonus` says]
    #[arg(long, value_name = "on|off")]
    shadows: Option<Switch>,
    /// Film size in pixels, at most 16384 a side and 67108864 in all [default: the scene's]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Graphics adapter for realtime scenes
    #[arg(long, value_enum, default_value_t = AdapterChoice::Auto)]
    adapter: AdapterChoice,
    /// Load the plugin into this process, without isolation, so that a debugger and prints work; only
    /// for your own plugin
    #[arg(long)]
    in_process: bool,
    /// Options for the plugin; only the reference renderer has any (`mistake=NAME`)
    #[arg(long, default_value = "", hide = true)]
    options: String,
}

/// Which adapter to draw with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum AdapterChoice {
    /// Hardware if available, otherwise software
    Auto,
    /// Hardware only
    Gpu,
    /// Software only (Mesa's lavapipe on Linux)
    Software,
}

impl AdapterChoice {
    /// As workers are told.
    pub fn adapter(self) -> Adapter {
        let kind = match self {
            Self::Auto => AdapterKind::Any,
            Self::Gpu => AdapterKind::Hardware,
            Self::Software => AdapterKind::Software,
        };
        Adapter { kind, name: String::new() }
    }
}

/// `on` or `off`.
#[derive(Clone, Copy, Debug)]
struct Switch(bool);

impl FromStr for Switch {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "on" => Ok(Self(true)),
            "off" => Ok(Self(false)),
            _ => Err(format!("expected on or off, found {text}")),
        }
    }
}

/// Width and height in pixels.
#[derive(Clone, Copy, Debug)]
struct Size(u32, u32);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("expected WIDTHxHEIGHT such as 640x480, found {text}");
        let (width, height) = text.split_once('x').ok_or_else(wrong)?;
        let side = |text: &str| match text.parse::<u32>() {
            Ok(0) => Err(wrong()),
            Ok(side) if side as usize <= MAX_SIDE => Ok(side),
            _ if !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit()) => {
                Err(format!("expected at most {MAX_SIDE} pixels a side, found {text}"))
            }
            _ => Err(wrong()),
        };
        let (width, height) = (side(width)?, side(height)?);
        let pixels = width as usize * height as usize;
        if pixels > MAX_PIXELS {
            return Err(format!("expected at most {MAX_PIXELS} pixels, found {pixels}"));
        }
        Ok(Self(width, height))
    }
}

/// Loads what a scene consists of, so that its mistakes are told in the user's own names, with what
/// it holds that no picture shows. The film has the size that is asked for. `output` is none of its files.
fn check_scene(toml: &Path, size: Option<Size>, output: &Path) -> anyhow::Result<SceneConfig> {
    let mut config = SceneConfig::load(toml)?;
    if let Some(Size(width, height)) = size {
        (config.width, config.height) = (width as usize, height as usize);
    }
    let warn = |remark: &String| eprintln!("umbra: warning: {remark}");
    config.remarks.iter().for_each(warn);
    let camera = Camera::new(config.camera, config.width, config.height)
        .with_context(|| toml.display().to_string())?;
    let mesh = config.load_mesh()?;
    let read = mesh.files.iter().map(|file| file.path.as_path());
    ensure_not_read(output, read.chain([toml, &config.mesh]))?;
    mesh.remarks.iter().for_each(warn);
    let folder = config.mesh.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let real = |path: &Path| path.canonicalize().with_context(|| path.display().to_string());
    let root = real(folder)?;
    if config.realtime
        && let Some(said) = range::out_of_range(&camera, &mesh)
    {
        eprintln!("umbra: warning: {}: {said}", config.mesh.display());
    }
    for file in &mesh.files {
        let path = &file.path;
        let target = real(path)?;
        if target.starts_with(&root) {
            continue;
        }
        let named_at = file.named_at.as_ref();
        let place = named_at.map(|(by, line)| format!("{}:{line}: ", by.display()));
        let link = if path.is_symlink() {
            format!("is a link to {}; ", target.display())
        } else {
            String::new()
        };
        bail!(
            "{}{}: {link}a renderer sees only the folder of the mesh, {}; hint: put the file there",
            place.unwrap_or_default(),
            path.display(),
            folder.display()
        );
    }
    Ok(config)
}

/// Renders the image and writes it.
///
/// # Errors
/// When the scene or plugin cannot be used, the plugin does not answer, or the image cannot be written.
pub fn run(arguments: &RenderArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let context = Context::new(root)?;
    let format = ImageFormat::of(&arguments.output)?;
    // A scene's other files lie where the file is, not where a link to it is.
    let scene_file = match arguments.scene.canonicalize() {
        Ok(target) if arguments.scene.is_symlink() => target,
        _ => arguments.scene.clone(),
    };
    let config = check_scene(&scene_file, arguments.size, &arguments.output)?;
    let (plugin, plugin_as_given) = plugin(&context, &arguments.plugin)?;
    ensure_not_read(&arguments.output, [plugin.as_path()])?;
    let request = request(arguments, &scene_file, &config)?;
    let save = |values: &[f32]| format.save(values, &config, &arguments.output);
    if arguments.in_process {
        ensure!(
            arguments.plugin != "reference",
            "--in-process is for your own plugin, to debug it"
        );
        save(&draw_in_process(&plugin, &request, &|_, _| ())?)?;
        return Ok(super::EXIT_OK);
    }
    let mut report = draw(&context, &Job { plugin: Some(plugin), requests: vec![request] });
    if INTERRUPTED.load(std::sync::atomic::Ordering::Relaxed) {
        return Ok(super::EXIT_INTERRUPTED);
    }
    let printed = report
        .runs
        .iter()
        .flat_map(|run| [&run.ended.stdout, &run.ended.stderr])
        .map(|printed| printed.head.clone() + &printed.tail)
        .collect::<String>();
    match report.outcomes.pop() {
        Some(Outcome::Done(answer)) => {
            save(&answer.values)?;
            eprint!("{printed}");
            Ok(super::EXIT_OK)
        }
        outcome => {
            let outcome = outcome.as_ref();
            let said = match outcome {
                // An error in a file needs no context.
                Some(Outcome::Failed(message)) => message.clone(),
                Some(outcome) => outcome.to_string(),
                None => "the worker gave no answer".to_owned(),
            };
            let as_given = |said: &str| as_given(said, &scene_file, &plugin_as_given);
            eprint!("{}", as_given(&printed));
            if outcome.and_then(Outcome::fault) == Some(Fault::Environment) {
                return Err(super::MachineLacks(as_given(&said)).into());
            }
            bail!("{}", as_given(&said))
        }
    }
}

/// The library of the renderer, and the path that it is named by.
fn plugin(context: &Context, named: &str) -> anyhow::Result<(PathBuf, PathBuf)> {
    let as_given = match named {
        "reference" => context.reference().context(
            "there is no reference renderer here (a student's kit has none); hint: cargo build --release --workspace",
        )?,
        path => PathBuf::from(path),
    };
    let plugin =
        as_given.canonicalize().with_context(|| format!("plugin {}", as_given.display()))?;
    if !plugin.is_file() {
        bail!(
            "plugin {}: it is {}, expected a library such as {}",
            as_given.display(),
            kind_of(&plugin),
            library_name("plugin")
        );
    }
    Ok((plugin, as_given))
}

/// What the renderer is asked for.
fn request(
    arguments: &RenderArguments,
    scene_file: &Path,
    config: &SceneConfig,
) -> anyhow::Result<Request> {
    let (width, height) = (config.width as u32, config.height as u32);
    let scene = SceneRef {
        path: scene_file.canonicalize().context("scene")?,
        options: arguments.options.clone(),
    };
    if config.realtime && arguments.spp.is_some() {
        eprintln!("umbra: warning: --spp has no effect: the scene is drawn in realtime");
    }
    Ok(if config.realtime {
        let shadow_map = arguments.shadows.map_or(config.bonus, |Switch(on)| on);
        let (adapter, cameras) =
            (arguments.adapter.adapter(), vec![CameraValue::from(config.camera)]);
        Request::RenderRealtime {
            scene,
            width,
            height,
            shadow_map,
            adapter,
            stages: vec![],
            cameras,
        }
    } else {
        Request::RenderOffline {
            scene,
            width,
            height,
            spp: arguments.spp.unwrap_or(config.spp as u32),
            seed: arguments.seed.or_else(|| own_seed(&arguments.output)).unwrap_or(0),
            threads: arguments.threads.unwrap_or_else(cores).max(1),
            shadows: arguments.shadows.is_none_or(|Switch(on)| on),
        }
    })
}

/// Has a worker draw the image, without a time limit: Ctrl-C ends it.
fn draw(context: &Context, job: &Job) -> JobReport {
    let limits = ProcessLimits {
        wall_s: 86_400.0,
        cpu_s: 1 << 20,
        file_size_mib: 8192,
        memory_mib: 16_384,
        ..ProcessLimits::default()
    };
    let begun = Instant::now();
    let report = context.supervisor.run_job(job, &limits, &INTERRUPTED, &mut |progress| {
        let (done, rows) = progress.rows;
        // A quick render needs no line in a log.
        if begun.elapsed() < Duration::from_secs(3) {
            return;
        }
        context.say(&format!("rendering: {done} of {rows} rows"));
    });
    context.progress.end();
    report
}

/// The student number of the submission that a file lies in, at its root or one folder deeper.
fn own_seed(file: &Path) -> Option<u64> {
    let file = std::path::absolute(file).ok()?;
    let configs = file.ancestors().skip(1).take(2).map(|folder| folder.join("config.json"));
    let mut found =
        configs.filter(|path| path.is_file()).filter_map(|path| std::fs::read(path).ok());
    found.find_map(|bytes| SubmittedConfig::parse(&bytes).0.sampler_seed())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_says_which_limit_it_breaks() {
        let said = |text: &str| text.parse::<Size>().map(|_| ()).unwrap_err();
        assert_eq!(said("16385x1"), "expected at most 16384 pixels a side, found 16385");
        assert_eq!(
            said("1x99999999999"),
            "expected at most 16384 pixels a side, found 99999999999"
        );
        assert_eq!(said("16384x4097"), "expected at most 67108864 pixels, found 67125248");
        for text in ["0x1", "1", "-1x1", "1x", "1x1x1", "+1x"] {
            assert_eq!(said(text), format!("expected WIDTHxHEIGHT such as 640x480, found {text}"));
        }
    }

    #[test]
    fn a_submission_s_images_have_the_seed_of_its_student() {
        let folder = tempfile::tempdir().unwrap();
        let offline = folder.path().join("offline");
        std::fs::create_dir(&offline).unwrap();
        assert_eq!(own_seed(&offline.join("a.exr")), None);
        let config = folder.path().join("config.json");
        std::fs::write(&config, r#"{"studentID": "", "renders": []}"#).unwrap();
        assert_eq!(own_seed(&offline.join("a.exr")), None);
        std::fs::write(&config, r#"{"studentID": "260331564", "renders": []}"#).unwrap();
        assert_eq!(own_seed(&offline.join("a.exr")), Some(260_331_564));
        assert_eq!(own_seed(&folder.path().join("b.exr")), Some(260_331_564));
    }
}
