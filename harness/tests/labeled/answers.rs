//! What a renderer with a labelled mistake answers, from closed forms.

use std::f64::consts::PI;

use basecode::{Frame, Sampler, Vec3};
use serde::Deserialize;
use serde_json::Value;
use umbra::evidence::bsdf::{self, BsdfKind};
use umbra::evidence::{Witness, WitnessQuery};

/// A mistake and what it is called: its changes, when `label` is set, and nothing otherwise.
#[derive(Clone, Debug, Deserialize)]
pub struct Labeled {
    pub name: String,
    /// The part that it belongs to, which says what is asked.
    pub part: String,
    pub changes: Vec<Change>,
    pub label: bool,
}

/// One change of the right formula.
#[derive(Clone, Debug, Deserialize)]
pub struct Change {
    /// `diffuse`, `specular` or `all`; `shadow`; a uniform; `position`, `normal` or `clip`.
    pub term: String,
    /// What of it; powers are what stands in the formula, so that 1 is right for `cos_i`.
    pub quantity: String,
    pub value: Value,
}

/// All of them.
pub fn labeled() -> Vec<Labeled> {
    serde_json::from_str(include_str!("mistakes.json")).unwrap()
}

/// A point that is shaded, and with what.
#[derive(Clone, Debug)]
pub struct Probe {
    pub scene: usize,
    pub phong: bool,
    pub kd: [f64; 3],
    pub ks: [f64; 3],
    pub n: f64,
    /// Whether the energy scale is applied by what is asked, not before.
    pub scales: bool,
    pub witness: Option<Witness>,
    pub wo: [f64; 3],
    pub wi: [f64; 3],
    pub r: f64,
    pub intensity: [f64; 3],
    pub position: Vec3,
    pub normal: Vec3,
    pub to_viewer: Vec3,
    pub light: Vec3,
}

/// A shadow ray: everything that it meets, from the surface on.
#[derive(Clone, Debug)]
pub struct ShadowRay {
    pub r: f64,
    pub occluders: Vec<f64>,
    pub place: f64,
}

/// What a pass bound, on one object.
#[derive(Clone, Debug)]
pub struct Bound {
    pub uniform: &'static str,
    pub scene: usize,
    pub object: usize,
    pub expected: Vec3,
    pub scale: f64,
}

/// A pixel that shows a surface point.
#[derive(Clone, Debug)]
pub struct Pixel {
    /// Of its center, from -1 to 1.
    pub ndc: [f64; 2],
    pub position: Vec3,
    pub normal: Vec3,
}

/// Questions with answers.
#[derive(Clone, Debug)]
pub enum Answers {
    Shading(Vec<(Probe, [f64; 3])>),
    Shadows(Vec<(ShadowRay, f64)>),
    Pass(Vec<(Bound, Vec3)>),
    /// Position, normal, place in clip space after division.
    Vertex(Vec<(Pixel, Vec3, Vec3, [f64; 2])>),
}

impl Answers {
    /// The answers alone.
    pub fn values(&self) -> Vec<[f64; 3]> {
        let three = |v: &Vec3| [f64::from(v.x), f64::from(v.y), f64::from(v.z)];
        match self {
            Self::Shading(all) => all.iter().map(|(_, found)| *found).collect(),
            Self::Shadows(all) => all.iter().map(|(_, found)| [*found; 3]).collect(),
            Self::Pass(all) => all.iter().map(|(_, found)| three(found)).collect(),
            Self::Vertex(all) => all
                .iter()
                .flat_map(|(_, p, n, ndc)| [three(p), three(n), [ndc[0], ndc[1], 0.0]])
                .collect(),
        }
    }
}

impl Labeled {
    /// What a renderer answers that has this mistake and no other.
    pub fn answers(&self) -> Answers {
        let shading = |probes: Vec<Probe>| {
            let noise = Sampler::new(0xA05E);
            let answer = |probe: Probe| {
                let found = self.shade(&probe, &noise);
                (probe, found)
            };
            Answers::Shading(probes.into_iter().map(answer).collect())
        };
        match self.part.as_str() {
            "1.1" => shading(bsdf_probes(BsdfKind::Diffuse)),
            "1.2" => shading(bsdf_probes(BsdfKind::Phong)),
            "1.3" => shading(points(&[
                Witness::Constant([0.3, 0.2, 0.1]),
                Witness::OfWi,
                Witness::OfWo,
                Witness::OfAngle,
            ])),
            "1.4" => self.shadows(),
            "2.1" => self.pass(),
            "2.2" => self.vertex(),
            "2.3" => shading(surfaces(false)),
            "2.4" => shading(surfaces(true)),
            other => panic!("part {other}"),
        }
    }

    fn of<'a>(&'a self, term: &str, quantity: &str) -> Option<&'a Value> {
        let all = matches!(term, "diffuse" | "specular");
        let own = |change: &&Change| {
            (change.term == term || all && change.term == "all") && change.quantity == quantity
        };
        self.changes.iter().find(own).map(|change| &change.value)
    }

    fn number(&self, term: &str, quantity: &str, right: f64) -> f64 {
        self.of(term, quantity).map_or(right, |value| value.as_f64().unwrap())
    }

    fn text<'a>(&'a self, term: &str, quantity: &str) -> &'a str {
        self.of(term, quantity).map_or("", |value| value.as_str().unwrap())
    }

    fn three(&self, term: &str, quantity: &str, right: [f64; 3]) -> [f64; 3] {
        let three = |value: &Value| {
            let list = value.as_array().unwrap();
            std::array::from_fn(|c| list[c].as_f64().unwrap())
        };
        self.of(term, quantity).map_or(right, three)
    }

    fn shade(&self, probe: &Probe, noise: &Sampler) -> [f64; 3] {
        let mut probe = probe.clone();
        if self.of("all", "light_shift").is_some() {
            let shift = self.three("all", "light_shift", [0.0; 3]).map(|v| v as f32);
            place(&mut probe, Vec3::from(shift));
        }
        let (cos_i, cos_o) = (probe.wi[2], probe.wo[2]);
        let random = 2.0 * f64::from(noise.next_1d()) - 1.0;
        if cos_i <= 0.0 || cos_o <= 0.0 {
            return [0.0; 3];
        }
        let powers = |term: &str| {
            let cosine = if probe.witness.is_some() { 0.0 } else { 1.0 };
            let pi = if probe.witness.is_some() { 0.0 } else { -1.0 };
            let squared = probe.r * probe.r + self.number(term, "r2_plus", 0.0);
            cos_i.powf(self.number(term, "cos_i", cosine))
                * cos_o.powf(self.number(term, "cos_o", 0.0))
                * PI.powf(self.number(term, "pi", pi))
                * squared.powf(0.5 * self.number(term, "r", -2.0))
                * self.number(term, "factor", 1.0)
                * (1.0 + self.number(term, "azimuth", 0.0) * self.place(&probe))
        };
        let order: [usize; 3] = match self.text("all", "channel_order") {
            "gbr" => [1, 2, 0],
            "" => [0, 1, 2],
            other => panic!("{other}"),
        };
        let scale = self.scale(&probe);
        let [diffuse, specular] = ["diffuse", "specular"].map(|term| {
            let times = |c: usize| {
                let color = if term == "diffuse" { probe.kd } else { probe.ks };
                let color = color[c].powf(self.number(term, "reflectance", 1.0));
                let scale = scale[c].powf(self.number(term, "scale", 1.0));
                color * scale * self.three(term, "channels", [1.0; 3])[c] * powers(term)
            };
            std::array::from_fn::<f64, 3, _>(times)
        });
        let lobe = self.lobe(&probe);
        let by_scene = 1.0 - self.number("all", "by_scene", 0.0) * (probe.scene + 1) as f64 / 2.0;
        std::array::from_fn(|c| {
            let reflected = match probe.witness {
                Some(witness) => {
                    let length = probe.r.powf(self.number("all", "wi_length", 0.0));
                    let query = WitnessQuery {
                        wi: probe.wi.map(|v| (v * length) as f32),
                        wo: probe.wo.map(|v| v as f32),
                    };
                    let value = witness.value(&query).unwrap();
                    f64::from(value[c]) * diffuse[c]
                }
                None if probe.phong => diffuse[c] + specular[c] * lobe,
                None => diffuse[c],
            };
            let mut incident = probe.intensity[order[c]];
            if probe.witness.is_some() {
                // What is clamped is the incident light, which holds the distance.
                let most = self.number("all", "clamp", f64::INFINITY) * probe.r * probe.r;
                incident = incident.min(most);
            }
            let value = incident * reflected + self.number("all", "offset", 0.0);
            let value = value * by_scene * (1.0 + self.number("all", "noise", 0.0) * random);
            let most = self.number("all", "clamp", f64::INFINITY);
            if probe.witness.is_some() { value } else { value.min(most) }
        })
    }

    /// Something that varies from place to place.
    fn place(&self, probe: &Probe) -> f64 {
        match probe.witness {
            Some(_) => f64::from(probe.position.x * 3.0).sin(),
            None => probe.wi[0],
        }
    }

    fn scale(&self, probe: &Probe) -> [f64; 3] {
        if !probe.phong || !probe.scales {
            return [1.0; 3];
        }
        let sums: [f64; 3] = std::array::from_fn(|c| probe.kd[c] + probe.ks[c]);
        let most = |v: [f64; 3]| v.into_iter().fold(0.0, f64::max);
        let of = |m: f64, above: f64| if m > 1.0 { above / m } else { 1.0 };
        match self.text("all", "scale_form") {
            "" => [of(most(sums), 0.99); 3],
            "always" => [0.99 / most(sums); 3],
            "mean" => [of(sums.iter().sum::<f64>() / 3.0, 0.99); 3],
            "channel" => sums.map(|m| of(m, 0.99)),
            "one" => [of(most(sums), 1.0); 3],
            other => panic!("{other}"),
        }
    }

    /// (n + 2) / 2 cos^n alpha: its 1 / pi is the term's.
    fn lobe(&self, probe: &Probe) -> f64 {
        let n = match self.text("specular", "exponent_form") {
            "truncated" => probe.n.trunc(),
            _ => probe.n,
        };
        let (wi, wo) = (probe.wi, probe.wo);
        let cos_alpha = (wi[2] * wo[2] - wi[0] * wo[0] - wi[1] * wo[1]).max(0.0);
        let exponent = n * self.number("specular", "exponent_times", 1.0)
            + self.number("specular", "exponent_plus", 0.0);
        let plus = self.number("specular", "normalisation_plus", 2.0);
        0.5 * (n + plus) * cos_alpha.powf(exponent)
    }

    fn shadows(&self) -> Answers {
        let sampler = Sampler::new(0x5AD0);
        let of = |quantity| self.number("shadow", quantity, f64::NAN);
        let ray = |index: usize| {
            let r = 0.5 + 3.0 * f64::from(sampler.next_1d());
            let at = |sampler: &Sampler| f64::from(sampler.next_1d());
            let mut occluders = Vec::new();
            if index.is_multiple_of(2) {
                let count = 1 + index / 2 % 2;
                occluders.extend((0..count).map(|_| r * (0.02 + 0.96 * at(&sampler))));
            }
            if index.is_multiple_of(3) {
                occluders.push(r * (1.02 + 2.0 * at(&sampler)));
            }
            occluders.sort_by(f64::total_cmp);
            ShadowRay { r, occluders, place: at(&sampler) }
        };
        let answer = |ray: ShadowRay| {
            let end = if self.of("shadow", "end_fraction").is_some() {
                of("end_fraction") * ray.r
            } else if self.of("shadow", "end_absolute").is_some() {
                of("end_absolute")
            } else {
                ray.r
            };
            let start = self.number("shadow", "start", 0.0);
            let dark = ray.occluders.iter().any(|t| (start..end).contains(t));
            let lit = self.number("shadow", "lit_remains", 1.0);
            let mut found = if dark { self.number("shadow", "remains", 0.0) } else { lit };
            if f64::from(sampler.next_1d()) < self.number("shadow", "noise", 0.0) {
                found = 1.0 - found;
            }
            if ray.place < self.number("shadow", "azimuth", 0.0) {
                found = 1.0;
            }
            (ray, found)
        };
        let rays: Vec<ShadowRay> = (0..2000).map(ray).collect();
        Answers::Shadows(rays.into_iter().map(answer).collect())
    }

    fn pass(&self) -> Answers {
        let sampler = Sampler::new(0x9A55);
        let mut all = Vec::new();
        for scene in 0..2 {
            let random = || Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d());
            let camera = 4.0 * random() - Vec3::ONE;
            let light = 3.0 * random() + Vec3::Y;
            let intensity = 1.0 + 20.0 * random();
            for object in 0..4 {
                let scale = if object % 2 == 0 { 1.0 } else { 0.5 + 0.3 * sampler.next_1d() };
                let (rho_d, rho_s) = (0.6 * scale * random(), 0.4 * scale * random());
                let n = [7.0, 20.0, 35.5, 90.0][object] + scene as f32;
                for (uniform, expected) in [
                    ("frame.camera_position", camera),
                    ("frame.light_position", light),
                    ("frame.light_intensity", intensity),
                    ("material.rho_d", rho_d),
                    ("material.rho_s", rho_s),
                    ("material.exponent", Vec3::new(n, 0.0, 1.0)),
                ] {
                    let scale = f64::from(scale);
                    all.push((Bound { uniform, scene, object, expected, scale }, camera));
                }
            }
        }
        let answer = |(bound, camera): (Bound, Vec3)| {
            let mut found = bound.expected;
            found *= self.number(bound.uniform, "factor", 1.0) as f32;
            if self.of(bound.uniform, "is").is_some() {
                assert_eq!(self.text(bound.uniform, "is"), "frame.camera_position");
                found = camera;
            }
            found *= bound.scale.powf(self.number(bound.uniform, "scale", 1.0) - 1.0) as f32;
            if self.text(bound.uniform, "channel_order") == "bgr" {
                found = Vec3::new(found.z, found.y, found.x);
            }
            let power = self.number(bound.uniform, "power", 1.0) as f32;
            if bound.uniform == "material.exponent" {
                found.x = found.x.powf(power);
            }
            let noise = self.number(bound.uniform, "noise", 0.0) as f32;
            found *= 1.0 + noise * (2.0 * sampler.next_1d() - 1.0);
            (bound, found)
        };
        Answers::Pass(all.into_iter().map(answer).collect())
    }

    fn vertex(&self) -> Answers {
        let sampler = Sampler::new(0x7E57);
        let pixel = |index: usize| {
            let (x, y) = (index % 40, index / 40);
            let ndc = [(x as f64 + 0.5) / 20.0 - 1.0, 1.0 - (y as f64 + 0.5) / 15.0];
            let random = || 2.0 * sampler.next_1d() - 1.0;
            let normal = Vec3::new(random(), random(), random()).normalize_or(Vec3::Y);
            let position = Vec3::new(2.0 * ndc[0] as f32, ndc[1] as f32, random());
            Pixel { ndc, position, normal }
        };
        let pixels: Vec<Pixel> = (0..1200).map(pixel).collect();
        let answer = |pixel: Pixel| {
            let position = pixel.position * self.number("position", "factor", 1.0) as f32;
            let noise = self.number("normal", "noise", 0.0) as f32;
            let normal = pixel.normal * self.number("normal", "factor", 1.0) as f32;
            let normal = (normal + noise * (sampler.next_1d() - 0.5)).normalize_or(Vec3::Y);
            let shift = self.three("clip", "shift", [0.0; 3]);
            let ndc = [pixel.ndc[0] + shift[0], pixel.ndc[1] + shift[1]];
            (pixel, position, normal, ndc)
        };
        Answers::Vertex(pixels.into_iter().map(answer).collect())
    }
}

fn bsdf_probes(kind: BsdfKind) -> Vec<Probe> {
    let probe = |probe: &bsdf::BsdfProbe| {
        let material = &probe.query.material;
        Probe {
            scene: 0,
            phong: kind == BsdfKind::Phong,
            kd: material.diffuse.map(f64::from),
            ks: material.specular.map(f64::from),
            n: f64::from(material.exponent),
            scales: true,
            witness: None,
            wo: probe.query.wo.map(f64::from),
            wi: probe.query.wi.map(f64::from),
            r: 1.0,
            intensity: [1.0; 3],
            position: Vec3::ZERO,
            normal: Vec3::Z,
            to_viewer: Vec3::from(probe.query.wo),
            light: Vec3::from(probe.query.wi),
        }
    };
    bsdf::probes(kind).iter().map(probe).collect()
}

/// The light stands elsewhere than it should: the same point anew.
fn place(probe: &mut Probe, shift: Vec3) {
    let frame = Frame::from_normal(probe.normal);
    let to_light = probe.light + shift - probe.position;
    let local = |v: Vec3| frame.to_local(v).to_array().map(f64::from);
    probe.r = f64::from(to_light.length());
    probe.wi = local(to_light.normalize());
    probe.wo = local(probe.to_viewer);
}

/// Lit points of two scenes, both directions well above the surface.
fn places() -> Vec<Probe> {
    let sampler = Sampler::new(0x9017);
    let random = || 2.0 * sampler.next_1d() - 1.0;
    let mut all = Vec::new();
    for (scene, light, intensity) in [
        (0, Vec3::new(0.3, 2.0, 0.5), [14.0, 9.0, 3.0]),
        (1, Vec3::new(-0.4, 1.2, 1.0), [1.2, 2.5, 4.0]),
    ] {
        while all.len() < 900 * (scene + 1) {
            let position = Vec3::new(1.5 * random(), random(), 1.5 * random());
            let normal = Vec3::new(random(), random(), random()).normalize_or(Vec3::Y);
            let to_viewer = Vec3::new(random(), random(), random()).normalize_or(Vec3::Y);
            let mut probe = Probe {
                scene,
                phong: false,
                kd: [1.0; 3],
                ks: [0.0; 3],
                n: 0.0,
                scales: false,
                witness: None,
                wo: [0.0; 3],
                wi: [0.0; 3],
                r: 1.0,
                intensity,
                position,
                normal,
                to_viewer,
                light,
            };
            place(&mut probe, Vec3::ZERO);
            if probe.wi[2] > 0.05 && probe.wo[2] > 0.05 {
                all.push(probe);
            }
        }
    }
    all
}

fn points(witnesses: &[Witness]) -> Vec<Probe> {
    let under = |&witness: &Witness| {
        places().into_iter().map(move |probe| Probe { witness: Some(witness), ..probe })
    };
    witnesses.iter().flat_map(under).collect()
}

/// What a fragment stage shades: colors come scaled.
fn surfaces(phong: bool) -> Vec<Probe> {
    let materials = [
        ([0.5, 0.3, 0.1], [0.2, 0.3, 0.5], 6.5),
        ([0.2, 0.4, 0.7], [0.5, 0.4, 0.1], 20.0),
        ([0.6, 0.6, 0.3], [0.3, 0.2, 0.4], 45.7),
        ([0.1, 0.2, 0.15], [0.8, 0.5, 0.6], 13.3),
    ];
    let mut all = places();
    for (index, probe) in all.iter_mut().enumerate() {
        let (kd, ks, n) = materials[index % materials.len()];
        (probe.phong, probe.kd, probe.ks, probe.n) = (phong, kd, ks, n);
        // Around the mirror direction, where highlights are seen.
        if phong && index % 3 > 0 {
            let frame = Frame::from_normal(probe.normal);
            let [x, y, z] = probe.wi.map(|v| v as f32);
            let spread = 0.25 * (index % 5) as f32 * Vec3::new(y, z, x);
            let wo = (Vec3::new(-x, -y, z) + spread).normalize();
            if wo.z > 0.05 {
                probe.wo = wo.to_array().map(f64::from);
                probe.to_viewer = frame.to_world(wo);
            }
        }
    }
    all
}
