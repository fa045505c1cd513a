use super::*;
use crate::Sampler;
use glam::{DVec3, Vec3, vec3};

fn random_vec3(sampler: &Sampler) -> Vec3 {
    vec3(sampler.next_1d(), sampler.next_1d(), sampler.next_1d()) * 2.0 - 1.0
}

/// Every triangle tested in f64: slow and without any tree.
fn brute_force(triangles: &[[Vec3; 3]], ray: &Ray) -> Option<(f64, usize, f64)> {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut best: Option<(f64, usize, f64)> = None;
    for (index, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|v| v.as_dvec3());
        let normal: DVec3 = (b - a).cross(c - a);
        let t = (a - origin).dot(normal) / direction.dot(normal);
        let p = origin + t * direction;
        let inside = |from: DVec3, to: DVec3| (to - from).cross(p - from).dot(normal);
        let margin = inside(a, b).min(inside(b, c)).min(inside(c, a)) / normal.length_squared();
        if margin >= 0.0
            && t >= f64::from(ray.min_t)
            && t <= f64::from(ray.max_t)
            && best.is_none_or(|(nearest, ..)| t < nearest)
        {
            best = Some((t, index, margin));
        }
    }
    best
}

#[test]
fn agrees_with_brute_force_in_f64() {
    let sampler = Sampler::new(1);
    let triangles: Vec<[Vec3; 3]> = (0..400)
        .map(|_| {
            let center = random_vec3(&sampler);
            [(); 3].map(|()| center + 0.2 * random_vec3(&sampler))
        })
        .collect();
    let blocks: Vec<bool> = (0..400).map(|i| i % 3 != 0).collect();
    let blocking: Vec<[Vec3; 3]> =
        triangles.iter().zip(&blocks).filter(|(_, b)| **b).map(|(t, _)| *t).collect();
    let bvh = Bvh::new(&triangles, &blocks);
    let (mut hits, mut shadowed) = (0, 0);
    for number in 0..4000 {
        let mut direction = random_vec3(&sampler).normalize();
        if number % 4 == 0 {
            direction = [Vec3::X, -Vec3::Y, Vec3::Z][number / 4 % 3]; // zero components
        }
        let ray = Ray::segment(random_vec3(&sampler) * 1.5, direction, 0.01, 1.5);
        let expected = brute_force(&triangles, &ray);
        let found = bvh.closest_hit(&ray);
        match (expected, found) {
            (Some((t, index, margin)), Some(hit)) if margin > 1e-5 => {
                assert_eq!(hit.triangle, index);
                assert!((f64::from(hit.t) - t).abs() < 1e-4, "{} {t}", hit.t);
                hits += 1;
            }
            (Some((_, _, margin)), None) => assert!(margin < 1e-5, "missed by {margin}"),
            (None, Some(hit)) => {
                let [u, v] = hit.barycentric;
                assert!(u.min(v).min(1.0 - u - v) < 1e-4, "hit nothing: {hit:?}");
            }
            _ => {}
        }
        let expected = brute_force(&blocking, &ray);
        if expected.is_none_or(|(.., margin)| margin > 1e-5) {
            assert_eq!(bvh.any_hit(&ray), expected.is_some());
            shadowed += usize::from(expected.is_some());
        }
    }
    assert!(hits > 500 && shadowed > 300, "too few rays hit: {hits}, {shadowed}");
}

/// Cards that double in size and distance make a tree like a ladder.
#[test]
fn deep_trees_are_walked_to_their_ends() {
    let card = |i: i32| {
        let size = 2f32.powi(i);
        [vec3(size, 0.0, 0.0), vec3(size, size, 0.0), vec3(size, 0.0, size)]
    };
    let triangles: Vec<[Vec3; 3]> = (-38..38).map(card).collect();
    let bvh = Bvh::new(&triangles, &[true; 76]);
    for (index, i) in (-38..38).enumerate() {
        let size = 2f32.powi(i);
        let from = vec3(size * 0.9, size * 0.2, size * 0.2);
        let ray = Ray::segment(from, Vec3::X, 0.0, size);
        assert_eq!(bvh.closest_hit(&ray).map(|hit| hit.triangle), Some(index));
        assert!(bvh.any_hit(&ray) && !bvh.any_hit(&Ray { direction: Vec3::Y, ..ray }));
    }
}

#[test]
fn odd_input_is_survived() {
    let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let flat = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X];
    for triangles in [vec![], vec![triangle], vec![flat], vec![triangle; 300]] {
        let bvh = Bvh::new(&triangles, &vec![true; triangles.len()]);
        let down = Ray::new(vec3(0.2, 0.2, 1.0), -Vec3::Z);
        assert_eq!(bvh.any_hit(&down), triangles.contains(&triangle));
        let nan = Ray::new(Vec3::NAN, Vec3::NAN);
        assert!(!bvh.any_hit(&nan) && bvh.closest_hit(&nan).is_none());
        bvh.any_hit(&Ray::new(Vec3::ZERO, Vec3::ZERO));
        bvh.any_hit(&Ray::new(Vec3::splat(1e30), Vec3::X));
    }
}

/// Triangles of every kind: of usual size, tiny, huge, without area, twice the same, in one plane.
fn odd_triangles(sampler: &Sampler) -> Vec<[Vec3; 3]> {
    let mut triangles = Vec::new();
    for number in 0..600 {
        let center = random_vec3(sampler);
        let size = [0.2, 0.2, 1e-4, 30.0][number % 4];
        let mut own = [(); 3].map(|()| center + size * random_vec3(sampler));
        match number % 50 {
            7 => own[1] = own[0],
            11 => own[2] = own[0] + 2.0 * (own[1] - own[0]),
            13 => own = own.map(|v| vec3(v.x, v.y, 0.25)),
            17 => own = triangles[number / 2],
            _ => {}
        }
        triangles.push(own);
    }
    triangles
}

/// What AVX2 answers is what every other machine does, bit by bit.
#[test]
fn both_paths_hit_the_same() {
    let sampler = Sampler::new(2);
    for scale in [1.0, 1e-12, 1e12] {
        let triangles =
            odd_triangles(&sampler).into_iter().map(|t| t.map(|v| scale * v)).collect::<Vec<_>>();
        let blocks: Vec<bool> = (0..triangles.len()).map(|i| i % 3 != 0).collect();
        let fast = Bvh::new(&triangles, &blocks);
        let portable = Bvh { avx2: false, ..Bvh::new(&triangles, &blocks) };
        let mut hits = 0;
        for number in 0..100_000 {
            let triangle = triangles[number % triangles.len()];
            let origin = scale * 2.0 * random_vec3(&sampler);
            // At vertices, at edges, along axes, and anywhere.
            let at = match number % 4 {
                0 => triangle[number / 4 % 3],
                1 => (triangle[0] + triangle[1]) / 2.0,
                2 => origin + [Vec3::X, -Vec3::Y, Vec3::Z][number / 4 % 3],
                _ => scale * random_vec3(&sampler),
            };
            let ray = Ray::segment(origin, (at - origin).normalize_or(Vec3::X), 0.0, scale * 10.0);
            let found = fast.closest_hit(&ray);
            assert_eq!(found, portable.closest_hit(&ray), "{ray:?}");
            assert_eq!(fast.any_hit(&ray), portable.any_hit(&ray), "{ray:?}");
            hits += usize::from(found.is_some());
        }
        assert!(hits > 10_000, "{hits}");
    }
}

/// From inside a closed surface no ray gets out, least of all by an edge or a vertex.
#[test]
fn edges_and_vertices_are_tight() {
    let sampler = Sampler::new(3);
    const SIDES: usize = 40;
    let vertex = |row: usize, side: usize| {
        let (polar, around) = (
            std::f32::consts::PI * row as f32 / SIDES as f32,
            std::f32::consts::TAU * (side % SIDES) as f32 / SIDES as f32,
        );
        let ring = if row.is_multiple_of(SIDES) { 0.0 } else { polar.sin() };
        vec3(ring * around.cos(), polar.cos(), ring * around.sin())
    };
    for moved in [Vec3::ZERO, vec3(100.0, -3.0, 7.0)] {
        let vertex = |row, side| vertex(row, side) + moved;
        let mut triangles = Vec::new();
        for row in 0..SIDES {
            for side in 0..SIDES {
                let [a, b, c, d] =
                    [(row, side), (row, side + 1), (row + 1, side), (row + 1, side + 1)]
                        .map(|(r, s)| vertex(r, s));
                triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
        let bvh = Bvh::new(&triangles, &vec![true; triangles.len()]);
        for number in 0..60_000 {
            let [a, b, _] = triangles[number % triangles.len()];
            let between = (number / triangles.len()) as f32 / 20.0;
            let origin = moved + 0.4 * random_vec3(&sampler);
            let ray =
                Ray::segment(origin, a.lerp(b, between.min(1.0)) - origin, 0.0, f32::INFINITY);
            assert!(bvh.closest_hit(&ray).is_some() && bvh.any_hit(&ray), "{ray:?}");
        }
    }
}

#[test]
fn of_equal_distances_the_lowest_index_counts() {
    let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let bvh = Bvh::new(&[triangle; 100], &[true; 100]);
    let ray = Ray::new(vec3(0.2, 0.2, 1.0), -Vec3::Z);
    assert_eq!(bvh.closest_hit(&ray).map(|hit| hit.triangle), Some(0));
}

/// All that a hierarchy holds.
fn content(bvh: &Bvh) -> Vec<u32> {
    let nodes = bvh.nodes.iter().flat_map(|node| {
        let bounds = node.bounds.iter().flatten().flat_map(|eight| eight.0.map(f32::to_bits));
        bounds.chain(node.children).chain([node.present])
    });
    nodes.chain(bvh.leaves.iter().flat_map(Triangles::content)).collect()
}

#[test]
fn any_number_of_threads_builds_the_same() {
    let sampler = Sampler::new(4);
    let mut triangles: Vec<_> = (0..50).flat_map(|_| odd_triangles(&sampler)).collect();
    triangles[20_000..25_000].fill([Vec3::ZERO, Vec3::X, Vec3::Y]);
    let blocks: Vec<bool> = (0..triangles.len()).map(|i| i % 3 != 0).collect();
    let alone = content(&Bvh::on_threads(&triangles, &blocks, 1));
    assert!(alone.len() > 12 * triangles.len());
    for threads in [2, 3, 16] {
        assert!(content(&Bvh::on_threads(&triangles, &blocks, threads)) == alone, "{threads}");
    }
}

/// A tree that would be too deep for a ray's stack is built in halves. Where triangles cross, rounding of boxes may
/// decide between two hits.
#[test]
fn a_tree_of_halves_hits_as_far_away() {
    let sampler = Sampler::new(5);
    let triangles = odd_triangles(&sampler);
    let blocks: Vec<bool> = (0..triangles.len()).map(|i| i % 3 != 0).collect();
    let usual = Bvh::new(&triangles, &blocks);
    let Wide { nodes, leaves, pending } = fold(&triangles, &blocks, 1, 0);
    assert!(pending < Stack::ROOM);
    let halved = Bvh { nodes, leaves, ..Bvh::new(&triangles, &blocks) };
    for number in 0..100_000 {
        let [a, b, _] = triangles[number % triangles.len()];
        let origin = 2.0 * random_vec3(&sampler);
        let at = [a, (a + b) / 2.0, random_vec3(&sampler)][number % 3];
        let ray = Ray::segment(origin, (at - origin).normalize_or(Vec3::X), 0.0, 10.0);
        let [a, b] = [&usual, &halved].map(|bvh| bvh.closest_hit(&ray).map(|hit| hit.t));
        assert_eq!(a.is_some(), b.is_some(), "{ray:?}");
        assert!(a.zip(b).is_none_or(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?} {ray:?}");
        assert_eq!(usual.any_hit(&ray), halved.any_hit(&ray), "{ray:?}");
    }
}

/// Eight rays at once hit what each hits alone, bit by bit, however they lie, and whichever are missing.
#[test]
fn eight_rays_hit_what_each_hits_alone() {
    let sampler = Sampler::new(6);
    let mut alone = 0;
    for scale in [1.0, 1e-12, 1e12] {
        let triangles =
            odd_triangles(&sampler).into_iter().map(|t| t.map(|v| scale * v)).collect::<Vec<_>>();
        let blocks: Vec<bool> = (0..triangles.len()).map(|i| i % 3 != 0).collect();
        let fast = Bvh::new(&triangles, &blocks);
        let portable = Bvh { avx2: false, ..Bvh::new(&triangles, &blocks) };
        let mut hits = 0;
        for number in 0..20_000 {
            let eye = scale * 2.0 * random_vec3(&sampler);
            let [a, b, _] = triangles[number % triangles.len()];
            // From one point, to one point, along axes, and anywhere; close together, or not; at vertices and edges.
            let spread = scale * [1e-6, 1e-2, 1.0][number / 4 % 3];
            let rays: [Option<Ray>; 8] = std::array::from_fn(|i| {
                let target =
                    [a, (a + b) / 2.0, a + spread * random_vec3(&sampler)][(number + i) % 3];
                let (from, to) = match number % 4 {
                    0 => (eye, target),
                    1 => (target, eye),
                    2 => (target - [Vec3::X, -Vec3::Y, Vec3::Z][number / 4 % 3] * scale, target),
                    _ => (scale * 2.0 * random_vec3(&sampler), target),
                };
                let direction = (to - from).normalize_or(Vec3::X);
                let end = if number % 4 == 1 { (to - from).length() } else { scale * 10.0 };
                let ray = Ray::segment(from, direction, 1e-4 * scale, end);
                (number % 5 != 0 || sampler.next_1d() < 0.2).then_some(ray)
            });
            for bvh in [&fast, &portable] {
                let closest = rays.map(|ray| bvh.closest_hit(&ray?));
                let any = rays.map(|ray| ray.is_some_and(|ray| bvh.any_hit(&ray)));
                assert_eq!(bvh.closest_hits(&rays), closest, "{rays:?}");
                assert_eq!(bvh.any_hits(&rays), any, "{rays:?}");
                hits += closest.iter().flatten().count();
            }
            alone += usize::from(rays.iter().flatten().count() < 2);
        }
        assert!(hits > 50_000, "{hits}");
    }
    assert!(alone > 100, "{alone}");
}

/// Walls along an axis, one upon the other: rounding puts hits before the boxes of their leaves. The order in which
/// leaves are visited must not decide.
#[test]
fn eight_rays_hit_the_same_of_walls_that_touch() {
    let sampler = Sampler::new(7);
    let wall = |number: u32| {
        let at = 1.0 + 6e-8 * (sampler.next_1d() * 20.0).floor();
        let corner = |_| 2.0 * random_vec3(&sampler);
        let axis = number as usize % 3;
        [0, 1, 2].map(corner).map(|mut corner| {
            corner[axis] = at;
            corner
        })
    };
    let triangles: Vec<_> = (0..600).map(wall).collect();
    let bvh = Bvh::new(&triangles, &vec![true; triangles.len()]);
    let mut hits = 0;
    for _ in 0..20_000 {
        let eye = 3.0 * random_vec3(&sampler);
        let target = random_vec3(&sampler);
        let rays: [Option<Ray>; 8] = std::array::from_fn(|_| {
            let target = target + 0.05 * random_vec3(&sampler);
            Some(Ray::segment(eye, (target - eye).normalize(), 1e-4, f32::INFINITY))
        });
        let alone = rays.map(|ray| bvh.closest_hit(&ray?));
        assert_eq!(bvh.closest_hits(&rays), alone, "{rays:?}");
        hits += alone.iter().flatten().count();
    }
    assert!(hits > 20_000, "{hits}");
}

/// A ray with NaN hits nothing, and does not change what the others hit.
#[test]
fn odd_rays_do_not_disturb_the_others() {
    let triangle = [[Vec3::ZERO, Vec3::X, Vec3::Y]];
    let down = Ray::segment(vec3(0.2, 0.2, 1.0), -Vec3::Z, 0.0, 5.0);
    let odd = [
        Ray { origin: Vec3::NAN, ..down },
        Ray { direction: vec3(f32::NAN, 0.0, -1.0), ..down },
        Ray { min_t: f32::NAN, ..down },
        Ray { max_t: f32::NAN, ..down },
        Ray { max_t: -1.0, ..down },
        Ray { direction: Vec3::ZERO, ..down },
        Ray { origin: Vec3::INFINITY, ..down },
    ];
    for bvh in [Bvh::new(&triangle, &[true]), Bvh { avx2: false, ..Bvh::new(&triangle, &[true]) }] {
        for (number, odd) in odd.into_iter().enumerate() {
            let mut rays = [Some(down); 8];
            rays[number] = Some(odd);
            let closest = rays.map(|ray| bvh.closest_hit(&ray?));
            assert_eq!(closest.iter().flatten().count(), 7, "{odd:?}");
            assert_eq!(bvh.closest_hits(&rays), closest, "{odd:?}");
            assert_eq!(bvh.any_hits(&rays), closest.map(|hit| hit.is_some()), "{odd:?}");
        }
        assert_eq!(bvh.any_hits(&[None; 8]), [false; 8]);
    }
    assert_eq!(Bvh::new(&[], &[]).closest_hits(&[Some(down); 8]), [None; 8]);
}
