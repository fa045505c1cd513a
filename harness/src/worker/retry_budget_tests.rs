use super::*;
use crate::process::{Captured, Exit};
use crate::worker::SceneRef;

fn scene() -> SceneRef {
    SceneRef { path: "a.toml".into(), options: String::new() }
}

fn render(side: u32, spp: u32) -> Request {
    let (seed, threads, shadows) = (1, 1, true);
    Request::RenderOffline {
        scene: scene(),
        width: side,
        height: side,
        spp,
        seed,
        threads,
        shadows,
    }
}

/// A submission's job: a render, and BSDF values.
fn job() -> Job {
    let bsdf = Request::EvalBsdf { scene: scene(), queries: Vec::new() };
    Job { plugin: Some("a.so".into()), requests: vec![render(32, 4), bsdf] }
}

const LATE: Option<Timeout> = Some(Timeout { computing: true, limit_s: 3.0, reference_s: None });

fn limits() -> ProcessLimits {
    ProcessLimits { wall_s: 10.0, cpu_s: 20, ..ProcessLimits::default() }
}

/// One whose questions all cost the same.
struct Slow(f64);

impl Reference for Slow {
    fn question_cpu_s(&self, _: &Request) -> Option<f64> {
        Some(self.0)
    }
    fn path_cpu_s(&self, _: &Request) -> Option<f64> {
        Some(10.0 * self.0)
    }
}

fn ended(cpu_s: f64, still_s: f64) -> ChildOutcome {
    ChildOutcome {
        exit: Exit::Code(0),
        pid: 1,
        stdout: Captured::default(),
        stderr: Captured::default(),
        wall_s: 0.0,
        cpu_s,
        still_s,
        peak_resident_mib: 0,
        peak_address_mib: 0,
        in_force: None,
        left_process: false,
    }
}

#[test]
fn one_confirmed_timeout_speaks_for_all_of_its_kind() {
    let (retries, job) = (RetryBudget::default(), job());
    let over = |index: usize| retries.given_up(&job, &job.requests[index]);
    assert!(retries.again(&job, 0, &limits()).is_some());
    assert!(matches!(retries.timed_out(&job, 0, LATE, true), Outcome::TimedOut(_)));
    assert_eq!(over(0), None);
    assert!(retries.again(&job, 0, &limits()).is_none(), "hanging renderers do not stall a batch");
    assert!(matches!(retries.timed_out(&job, 0, LATE, false), Outcome::TimedOut(_)));
    let not_asked = over(0).unwrap();
    assert_eq!(not_asked.fault(), Some(Fault::Submission));
    // What was late is named where it is not asked again.
    let said = not_asked.to_string();
    assert!(
        said.contains("(endless loop: no answer within") || said.contains("(stuck: "),
        "{said}"
    );
    // Another kind of question is another matter, and so are images without shadows.
    assert_eq!(over(1), None);
    let mut plain = job.clone();
    if let Request::RenderOffline { shadows, .. } = &mut plain.requests[0] {
        *shadows = false;
    }
    assert_eq!(retries.given_up(&plain, &plain.requests[0]), None);
    assert!(retries.again(&job, 1, &limits()).is_some());
    retries.renew();
    assert_eq!(over(0), None);
    assert!(retries.again(&job, 0, &limits()).is_some());
}

#[test]
fn what_nobody_confirms_costs_nothing() {
    let (retries, job) = (RetryBudget::default(), job());
    for _ in 0..MAX_RETRIES {
        // Asked again, it answered.
        assert!(retries.again(&job, 0, &limits()).is_some());
    }
    assert!(retries.again(&job, 0, &limits()).is_none());
    let late = || retries.timed_out(&job, 0, LATE, false);
    assert_eq!(late().fault(), Some(Fault::Environment));
    assert_eq!(late().fault(), Some(Fault::Environment));
    let over = retries.given_up(&job, &job.requests[0]);
    assert_eq!(over.and_then(|o| o.fault()), Some(Fault::Environment));
    assert!(!is_environment_failure(&late()));
}

#[test]
fn a_machine_that_is_too_busy_costs_nothing_even_alone() {
    let (retries, job) = (RetryBudget::default(), job());
    assert!(retries.again(&job, 0, &limits()).is_some());
    assert_eq!(retries.timed_out(&job, 0, None, true).fault(), Some(Fault::Environment));
}

#[test]
fn without_patience_every_timeout_counts() {
    let (retries, job) = (RetryBudget::none(), job());
    assert!(retries.again(&job, 0, &limits()).is_none());
    assert!(matches!(retries.timed_out(&job, 0, LATE, false), Outcome::TimedOut(_)));
    let allowed = retries.allowed(&job, &[0, 1], &limits());
    assert_eq!(allowed.limits, limits());
}

#[test]
fn a_question_has_what_fits_it_and_ten_times_the_reference_when_it_counts() {
    let slow = Slow(2.0);
    let retries = RetryBudget::with(Some(&slow), None);
    let mut job = job();
    job.requests.push(render(1000, 16));
    let allowed = retries.allowed(&job, &[0, 1, 2], &limits());
    let first =
        [FIRST_S + 4096.0 * FIRST_S_PER_SAMPLE, FIRST_S, FIRST_S + 16e6 * FIRST_S_PER_SAMPLE];
    assert_eq!(allowed.each_cpu_s, first);
    assert_eq!(allowed.limits.cpu_s, first.iter().sum::<f64>().ceil() as u64 + 1);
    let again = retries.again(&job, 0, &limits()).unwrap();
    assert_eq!(again.each_cpu_s, [20.0]);
    let said = retries.timed_out(&job, 0, LATE, true);
    assert_eq!(said, Outcome::TimedOut(Timeout { reference_s: Some(2.0), ..LATE.unwrap() }));
    // From now on renders have three times what the reference takes.
    let short = retries.allowed(&job, &[0], &limits());
    assert_eq!((short.each_cpu_s, short.limits.wall_s), (vec![6.0], 2.0));
    assert_eq!(retries.allowed(&job, &[1], &limits()).each_cpu_s, [FIRST_S]);
    // Without a reference, as in a student's kit.
    let own = RetryBudget::with(None, None);
    let again = |index| own.again(&job, index, &limits()).unwrap().each_cpu_s[0];
    assert_eq!((again(1), again(2)), (6.0, first[2].max(20.0)));
}

#[test]
fn a_budget_ends_a_path_by_cpu_time_of_the_reference_or_by_standing_still() {
    let slow = Slow(0.5);
    let budget = || Some(Budget { times_reference: 10.0, cpu_s: 30.0, still_s: 20.0 });
    let job = job();
    let neutral = Job { plugin: None, ..job.clone() };
    let retries = RetryBudget::with(Some(&slow), budget());
    let over = || retries.given_up(&job, &job.requests[0]);
    retries.spent(&job, &ended(31.0, 1.0));
    retries.spent(&neutral, &ended(1000.0, 1000.0));
    // Ten times the reference's five seconds.
    assert_eq!(over(), None);
    retries.spent(&job, &ended(18.0, 1.0));
    assert_eq!(retries.allowed(&job, &[0], &limits()).limits.cpu_s, 2);
    retries.spent(&job, &ended(1.5, 0.0));
    let said = retries.used_up().unwrap();
    assert!(said.starts_with("50 s of CPU time, where 50 s are allowed, 10 times"), "{said}");
    assert_eq!(over().and_then(|o| o.fault()), Some(Fault::Submission));
    assert_eq!(retries.given_up(&neutral, &neutral.requests[0]), None);
    retries.renew();
    assert_eq!(over(), None);

    // What stands still, and does so again alone, leaves half of the time for other questions.
    let still_s = || retries.allowed(&job, &[0], &limits()).limits.wall_s;
    assert_eq!(still_s(), 5.0);
    retries.spent(&job, &ended(1.0, 5.0));
    assert_eq!(still_s(), 3.75);
    retries.spent(&job, &ended(1.0, 14.5));
    assert!((still_s() - 0.6).abs() < 1e-9);
    retries.spent(&job, &ended(1.0, 0.6));
    assert!(retries.used_up().unwrap().starts_with("20 s of doing nothing"));
    // Nobody has less than the seconds that everybody has, and without a budget nothing ends.
    let none = RetryBudget::with(Some(&slow), None);
    none.spent(&job, &ended(1e6, 1e6));
    assert_eq!(none.given_up(&job, &job.requests[0]), None);
}

#[test]
fn environment_failures_are_recognized() {
    let machine = |fault| Outcome::NotRun { reason: "x".into(), fault };
    for (outcome, blames) in [
        (Outcome::NoAdapter(String::new()), true),
        (machine(Fault::Environment), true),
        (machine(Fault::Internal), true),
        (machine(Fault::Submission), false),
        (
            Outcome::NotRun {
                reason: format!("{CANNOT_RUN}: no space"),
                fault: Fault::Environment,
            },
            false,
        ),
        (Outcome::Failed("Parent device is lost".into()), true),
        (Outcome::Panicked("No space left on device (os error 28)".into()), true),
        (Outcome::Failed("lost in thought".into()), false),
        (Outcome::ExitedEarly(75), false),
        (Outcome::TimedOut(LATE.unwrap()), false),
    ] {
        assert_eq!(is_environment_failure(&outcome), blames, "{outcome:?}");
    }
}
