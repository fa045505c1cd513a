//! Rays are refused in the whole process while a render pass lives: so this test has one of its own.

use std::any::Any;
use std::panic::catch_unwind;

use basecode::realtime::{RayRefused, Realtime};
use basecode::{Bvh, Ray, Vec3};

#[test]
fn a_ray_is_refused_while_a_pass_lives_and_never_forgotten() {
    let triangle = [[Vec3::ZERO, Vec3::X, Vec3::Y]];
    let bvh = Bvh::new(&triangle, &[true]);
    let ray = Ray::segment(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z, 1e-3, 9.0);
    let hit = || catch_unwind(|| bvh.any_hit(&ray));
    let refused = |payload: Box<dyn Any + Send>| payload.is::<RayRefused>();
    assert!(hit().is_ok_and(|hit| hit));
    let first = Realtime::begin();
    assert!(first.without_rays().is_ok());
    let second = Realtime::begin();
    assert!(catch_unwind(|| Bvh::new(&triangle, &[true])).is_err_and(refused));
    // Caught or not, and from whatever thread.
    assert!(std::thread::scope(|s| s.spawn(hit).join()).is_ok_and(|hit| hit.is_err_and(refused)));
    assert!(hit().is_err_and(refused));
    drop(second);
    assert!(first.without_rays().is_err() && hit().is_err());
    drop(first);
    assert!(hit().is_ok_and(|hit| hit));
    assert!(Realtime::begin().without_rays().is_ok());
}
