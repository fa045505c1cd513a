//! The policy of a worker: what it sees. That is the plugin, the scenes it is asked about, its own files and the
//! system's libraries, all under neutral names.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use basecode::scene::SceneConfig;

use super::job::{AdapterKind, Job, Request};
use super::shaders;
use super::wire::WorkerFolder;
use crate::sandbox::policy::{JOB, PLUGIN, SCENE};
use crate::sandbox::{Bind, ChildKind, Gpu, Layers, Policy};

/// A policy, and the names by which the worker is told of things.
pub struct WorkerPolicy {
    /// What it sees.
    pub policy: Policy,
    /// The plugin, when there is one.
    pub plugin: Option<PathBuf>,
    /// The TOML file of each request's scene.
    pub scenes: Vec<PathBuf>,
    /// The folder with its own files.
    pub job: PathBuf,
}

impl WorkerPolicy {
    /// For a worker with the private folder `dir`.
    ///
    /// # Errors
    /// When the current folder is not known, or the plugin's path names no file.
    pub fn new(dir: &Path, job: &Job, requests: &[&Request], layers: Layers) -> io::Result<Self> {
        let mut policy = Policy::new(ChildKind::Worker);
        policy.layers = layers;
        policy.scratch.without_mount = Some(WorkerFolder(dir).scratch());
        policy.report = Some(dir.join("report"));
        let inside = WorkerFolder(Path::new(JOB));
        let folder = WorkerFolder(dir);
        policy.read_only.push(Bind::new(folder.job(), inside.job()));
        policy.read_only.push(Bind::new(folder.input(), inside.input()));
        policy.read_write.push(Bind::new(folder.output(), inside.output()));
        policy.read_write.push(Bind::new(folder.table(), inside.table()));
        let plugin = match &job.plugin {
            Some(plugin) => {
                let plugin = std::path::absolute(plugin)?;
                let name = plugin.file_name().ok_or(io::ErrorKind::InvalidFilename)?;
                // A plugin that is not there is for the worker to miss.
                if plugin.exists() {
                    policy.read_only.push(Bind::new(&plugin, Path::new(PLUGIN).join(name)));
                }
                Some(policy.seen(&plugin))
            }
            None => None,
        };
        let mut roots = Vec::new();
        let mut scenes = Vec::new();
        for request in requests {
            scenes.push(scene(&request.scene().path, &mut roots, &mut policy)?);
        }
        let drawn_by = |request: &&Request| request.adapter();
        if requests.iter().filter_map(drawn_by).any(|kind| kind != AdapterKind::Software) {
            let usual = Policy::new(ChildKind::Worker).read_only;
            let is_seen = |path: &Path| usual.iter().any(|bind| path.starts_with(&bind.host));
            policy.gpu = Gpu::of_this_machine(&is_seen);
        }
        let job = if layers.mount_ns { PathBuf::from(JOB) } else { dir.to_owned() };
        Ok(Self { policy, plugin, scenes, job })
    }
}

impl WorkerPolicy {
    /// Gives it the pipes of a live worker; they must be there.
    pub fn live(&mut self, dir: &Path) {
        let (folder, inside) = (WorkerFolder(dir), WorkerFolder(Path::new(JOB)));
        self.policy.read_only.push(Bind::new(folder.cameras(), inside.cameras()));
        self.policy.read_write.push(Bind::new(folder.frames(), inside.frames()));
    }

    /// Gives it compiled shaders where it draws, and lets it leave its own in `leaves`.
    pub fn shaders(&mut self, requests: &[&Request], given: &[PathBuf], leaves: Option<&Path>) {
        // Without a mount namespace there is no place for them.
        let draws = requests.iter().any(|request| request.adapter().is_some());
        if !draws || !self.policy.layers.mount_ns {
            return;
        }
        for (number, folder) in given.iter().enumerate() {
            let inside = shaders::given(Path::new(JOB), number);
            self.policy.read_only.push(Bind::new(folder, inside));
        }
        if let Some(folder) = leaves {
            self.policy.read_write.push(Bind::new(folder, shaders::left(Path::new(JOB))));
        }
    }
}

/// Binds a scene's TOML file and the folder of its mesh, which lie to each other as on the host, and
/// answers the former's name inside. `roots` are the folders that hold both, of scenes so far.
fn scene(toml: &Path, roots: &mut Vec<PathBuf>, policy: &mut Policy) -> io::Result<PathBuf> {
    let toml = std::path::absolute(toml)?;
    if !policy.layers.mount_ns {
        // Landlock needs the folders all the same.
        let given = mesh_folder(&toml).into_iter().chain(Some(toml.clone()));
        given.filter(|path| path.exists()).for_each(|path| add(policy, Bind::same(path)));
        return Ok(toml);
    }
    // The kernel goes from the true folder to `..`, not from a link to it.
    let folder = toml.parent().and_then(|folder| fs::canonicalize(folder).ok());
    let (Some(folder), Some(name)) = (folder, toml.file_name()) else { return Ok(toml) };
    let toml = folder.join(name);
    let mesh = mesh_folder(&toml);
    let root = root_of(&folder, &toml, mesh.as_deref());
    let number = roots.iter().position(|known| *known == root).unwrap_or_else(|| {
        roots.push(root.clone());
        roots.len() - 1
    });
    let inside = |path: &Path| {
        let rest = path.strip_prefix(&root).unwrap_or(Path::new(""));
        Path::new(SCENE).join(number.to_string()).join(rest)
    };
    // Without a mesh folder it is no scene: the plugin is to say so, or that there is no such file.
    if let Some(mesh) = mesh {
        // A path that ends in a slash would name the folder itself otherwise.
        let at =
            if mesh == root { Path::new(SCENE).join(number.to_string()) } else { inside(&mesh) };
        add(policy, Bind::new(&mesh, at));
        if !toml.starts_with(&mesh) && toml.is_file() {
            add(policy, Bind::new(&toml, inside(&toml)));
        }
    } else if toml.is_file() {
        add(policy, Bind::new(&toml, inside(&toml)));
    }
    Ok(inside(&toml))
}

/// A worker's words with the user's names of a scene and a plugin in the place of those that the
/// worker sees: `toml` and `plugin` are the paths as the user gave them.
pub fn as_given(words: &str, toml: &Path, plugin: &Path) -> String {
    let given = toml.parent().unwrap_or(Path::new(""));
    let mut names = Vec::new();
    if let Ok(folder) =
        fs::canonicalize(if given.as_os_str().is_empty() { Path::new(".") } else { given })
    {
        let toml = folder.join(toml.file_name().unwrap_or_default());
        let root = root_of(&folder, &toml, mesh_folder(&toml).as_deref());
        let scene = Path::new(SCENE).join("0");
        let rest = folder.strip_prefix(&root).unwrap_or(Path::new(""));
        // Without a mount namespace workers see true names.
        names.push((folder.clone(), given.to_owned()));
        if !rest.as_os_str().is_empty() {
            names.push((scene.join(rest), given.to_owned()));
        }
        let above = if rest.as_os_str().is_empty() { given.to_owned() } else { root };
        names.push((scene, above));
    }
    let seen = Path::new(PLUGIN);
    names.push((seen.to_owned(), plugin.parent().unwrap_or(Path::new("")).to_owned()));
    let mut said = String::new();
    let mut rest = words;
    while !rest.is_empty() {
        // A name begins where a word does: one that only contains it stays.
        let begins = !said.ends_with(|c: char| c.is_alphanumeric() || "/._-".contains(c));
        let name = names.iter().find_map(|(seen, given)| {
            let inside = rest.strip_prefix(seen.to_str()?)?.strip_prefix('/')?;
            Some((given, inside))
        });
        if let Some((given, inside)) = name.filter(|_| begins) {
            // An empty folder leaves the name that follows.
            said += &given.join("").to_string_lossy();
            rest = inside;
        } else {
            let end = rest.char_indices().nth(1).map_or(rest.len(), |(at, _)| at);
            said += &rest[..end];
            rest = &rest[end..];
        }
    }
    said
}

fn add(policy: &mut Policy, bind: Bind) {
    if !policy.read_only.contains(&bind) {
        policy.read_only.push(bind);
    }
}

/// The folder of a scene's mesh, materials and textures, when there is one.
fn mesh_folder(toml: &Path) -> Option<PathBuf> {
    let mesh = plain(&SceneConfig::load(toml).ok()?.mesh);
    mesh.parent().filter(|folder| folder.is_dir()).map(Path::to_owned)
}

/// The folder that holds a scene's TOML file, its mesh, and all that the way from one to the other goes through:
/// `../teapot/s.obj` leads above the folder `teapot`, even from there.
fn root_of(folder: &Path, toml: &Path, mesh: Option<&Path>) -> PathBuf {
    let mut top = common(folder, mesh.unwrap_or(folder));
    let way = SceneConfig::load(toml).map(|config| config.mesh).unwrap_or_default();
    let mut at = PathBuf::new();
    for part in way.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                at.pop();
                top = common(&top, &at);
            }
            part => at.push(part),
        }
    }
    top
}

/// A path without `.` and `..`, by its text.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => drop(plain.pop()),
            part => plain.push(part),
        }
    }
    plain
}

/// The deepest folder that holds both.
fn common(a: &Path, b: &Path) -> PathBuf {
    let pairs = a.components().zip(b.components());
    pairs.take_while(|(a, b)| a == b).map(|(a, _)| a).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assignment::Assignment;
    use crate::worker::SceneRef;

    /// Names and order of what a worker sees of a scene, and by what path it is told of it.
    fn seen(dir: &Path, toml: &Path) -> (Vec<PathBuf>, Vec<PathBuf>, Vec<PathBuf>) {
        let scene = SceneRef { path: toml.to_owned(), options: String::new() };
        let request = Request::EvalBsdf { scene, queries: Vec::new() };
        let job = Job { plugin: None, requests: vec![request.clone()] };
        let own = WorkerPolicy::new(dir, &job, &[&request], Layers::full()).unwrap();
        let scene = own.policy.read_only.iter().filter(|bind| bind.inside.starts_with(SCENE));
        let mut names = Vec::new();
        for bind in scene.clone().filter(|bind| bind.host.is_dir()) {
            for file in bind.host.read_dir().unwrap() {
                names.push(bind.inside.join(file.unwrap().file_name()));
            }
        }
        names.sort();
        (own.scenes, scene.map(|bind| bind.inside.clone()).collect(), names)
    }

    #[test]
    fn words_of_a_worker_name_what_the_user_named() {
        let place = tempfile::tempdir().unwrap();
        for folder in ["tinyrender", "mesh"] {
            fs::create_dir(place.path().join(folder)).unwrap();
        }
        let split = place.path().join("tinyrender/s.toml");
        fs::write(&split, "[input]\nobjfile = \"../mesh/s.obj\"\n").unwrap();
        let flat = place.path().join("s.toml");
        fs::write(&flat, "[input]\nobjfile = \"s.obj\"\n").unwrap();
        let plugin = Path::new("target/libp.so");
        let root = place.path().display();
        for (toml, words, expected) in [
            (&flat, "/scene/0/s.obj:3: x", format!("{root}/s.obj:3: x")),
            (&flat, "a \"/scene/0/t.png\", /scene/0/u", format!("a \"{root}/t.png\", {root}/u")),
            (&flat, "/my/scene/0/s.obj", "/my/scene/0/s.obj".to_owned()),
            (&flat, "(/plugin/libp.so)", "(target/libp.so)".to_owned()),
            (
                &split,
                "/scene/0/tinyrender/../mesh/s.obj",
                format!("{root}/tinyrender/../mesh/s.obj"),
            ),
            (&split, "/scene/0/mesh/s.obj", format!("{root}/mesh/s.obj")),
        ] {
            assert_eq!(as_given(words, toml, plugin), expected);
        }
        let bare = as_given("/plugin/p.so: /scene/0/s.obj", Path::new("s.toml"), Path::new("p.so"));
        assert_eq!(bare, "p.so: s.obj");
    }

    #[test]
    fn a_held_back_scene_looks_like_its_original() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let assignment = Assignment::load(root).unwrap();
        let (held_back, entries) = crate::held_back::make(&assignment, 5).unwrap();
        let dir = tempfile::tempdir().unwrap();
        for (entry, (_, original)) in entries.iter().zip(&held_back.scenes) {
            let scene = assignment.scenes.iter().find(|scene| scene.name == *original).unwrap();
            let tomls = |entry: &crate::assignment::SceneEntry| {
                [Some(entry.offline.clone()), Some(entry.realtime.clone()), entry.bonus.clone()]
            };
            let tomls = tomls(entry).into_iter().zip(tomls(scene));
            for (changed, public) in tomls.filter_map(|(a, b)| Some((a?, root.join(b?)))) {
                assert!(changed.is_file() && public.is_file());
                assert_eq!(seen(dir.path(), &changed), seen(dir.path(), &public));
            }
        }
    }
}
