//! Hostile plugins: what each does, and exactly what must come of it.

use umbra::sandbox::Layers;
use umbra::worker::{Fault, Outcome};

use crate::fixture::{Asked, Fixture};

/// One hostile plugin.
pub struct Plugin {
    pub name: &'static str,
    /// Its library in the stage.
    pub library: &'static str,
    /// What it is told to do.
    pub action: Action,
    asked: Asked,
    expect: Expect,
    /// Whether the questions before and after the action must be answered.
    around: bool,
    /// Whether the action must succeed without any isolation: one that cannot proves nothing.
    control: bool,
}

/// Options of a scene, or what makes them where a case runs.
#[derive(Clone, Copy)]
pub enum Action {
    Is(&'static str),
    Made(fn(&Fixture) -> String),
}

/// What must become of the question at which the plugin acts.
enum Expect {
    /// Zeros, as if nothing were amiss.
    Zeros,
    /// An answer of the right size with whatever in it.
    Anything,
    /// An answer of values that are not finite.
    NotFinite,
    Crash(&'static str),
    Exit(i32),
    TimedOut,
    OutOfMemory,
    FileTooLarge,
    /// These and the next: the beginning of the message.
    Failed(&'static str),
    NotImplemented(&'static str),
    Panicked(&'static str),
    /// Some text in the message.
    Rejected(&'static str),
    NoAdapter,
    /// The plugin forged Umbra's own word; grading asks the reference.
    Ours,
}

impl Plugin {
    pub fn options(&self, fixture: &Fixture) -> String {
        match self.action {
            Action::Is(text) => text.to_owned(),
            Action::Made(make) => make(fixture),
        }
    }

    /// Runs it and answers what came of it.
    pub fn run(&self, fixture: &mut Fixture) -> Result<String, String> {
        let options = self.options(fixture);
        let limits = fixture.limits(matches!(self.expect, Expect::TimedOut));
        let asked = [(Asked::Offline, ""), (self.asked, &*options), (Asked::Offline, "")];
        let report = fixture.ask(self.library, &asked, &limits);
        let said = format!("{:?}", report.outcomes[1]);
        let short: String = said.chars().take(100).collect();
        if !self.expect.holds(&report.outcomes[1]) {
            return Err(format!("{short}\n{:#?}", report.runs));
        }
        let calm = |outcome: &Outcome| Expect::Zeros.holds(outcome);
        if self.around && !(calm(&report.outcomes[0]) && calm(&report.outcomes[2])) {
            let around = [&report.outcomes[0], &report.outcomes[2]];
            return Err(format!("a question beside it was harmed: {around:?}"));
        }
        if options.starts_with("keep ") {
            // Another worker of the same plugin, with no stage given.
            let again = fixture.ask(self.library, &[(Asked::Realtime, &options)], &limits);
            if !calm(&again.outcomes[0]) {
                return Err(format!("{:?}", again.outcomes[0]));
            }
        }
        let next = fixture.ask("fault.so", &[(Asked::Offline, "")], &limits);
        if !calm(&next.outcomes[0]) {
            return Err(format!("the next submission was harmed: {:?}", next.outcomes[0]));
        }
        Ok(short)
    }

    /// Without isolation the action must succeed, where that hurts nobody.
    pub fn control(&self, fixture: &Fixture) -> Result<(), String> {
        let options = self.options(fixture);
        let (asked, limits) = ([(self.asked, &*options)], fixture.limits(false));
        let free = |()| fixture.ask_without(Layers::NONE, self.library, &asked, &limits);
        match self.control.then_some(()).map(free) {
            Some(free) if self.expect.holds(&free.outcomes[0]) => {
                Err(format!("without isolation the same: {:?}", free.outcomes[0]))
            }
            _ => Ok(()),
        }
    }
}

impl Expect {
    fn holds(&self, outcome: &Outcome) -> bool {
        match (self, outcome) {
            (Self::Zeros, Outcome::Done(answer)) => answer.values.iter().all(|v| *v == 0.0),
            (Self::Anything, Outcome::Done(_)) => true,
            (Self::NotFinite, Outcome::Done(answer)) => {
                answer.values.iter().all(|value| !value.is_finite())
            }
            (Self::Crash(name), Outcome::CrashedBySignal(by)) => name == by,
            (Self::Exit(code), Outcome::ExitedEarly(by)) => code == by,
            (Self::TimedOut, Outcome::TimedOut(_))
            | (Self::OutOfMemory, Outcome::OutOfMemory)
            | (Self::FileTooLarge, Outcome::FileTooLarge)
            | (Self::NoAdapter, Outcome::NoAdapter(_)) => true,
            (Self::Failed(text), Outcome::Failed(said))
            | (Self::NotImplemented(text), Outcome::NotImplemented(said))
            | (Self::Panicked(text), Outcome::Panicked(said)) => said.starts_with(text),
            (Self::Rejected(text), Outcome::Rejected(said)) => said.contains(text),
            (Self::Ours, Outcome::NotRun { fault, .. }) => *fault == Fault::Internal,
            _ => false,
        }
    }
}

/// An action of the plugin in C, in an offline render.
fn c(name: &'static str, action: &'static str, expect: Expect) -> Plugin {
    let (library, action) = ("fault.so", Action::Is(action));
    Plugin { name, library, action, asked: Asked::Offline, expect, around: true, control: false }
}

/// The same with words that depend on the place; without isolation it must succeed.
fn made(name: &'static str, action: fn(&Fixture) -> String, expect: Expect) -> Plugin {
    Plugin { action: Action::Made(action), control: true, ..c(name, "", expect) }
}

/// An action of the plugin in Rust.
fn rust(name: &'static str, action: &'static str, asked: Asked, expect: Expect) -> Plugin {
    Plugin { library: "hostile.so", asked, ..c(name, action, expect) }
}

/// A library that cannot even be loaded well: every question has the same outcome.
fn loaded(name: &'static str, library: &'static str, expect: Expect) -> Plugin {
    Plugin { library, around: false, ..c(name, "", expect) }
}

/// All of them.
pub fn all() -> Vec<Plugin> {
    use Asked::{Offline, Realtime, RealtimeWithStages};
    use Expect::*;
    vec![
        rust("panic", "panic", Offline, Panicked("on purpose")),
        rust("todo", "todo", Offline, NotImplemented("")),
        rust("panic_in_thread", "panic_in_thread", Offline, Panicked("a good thread")),
        rust("panic_in_a_lost_thread", "panic_in_a_lost_thread", Offline, Zeros),
        rust("panic_while_panicking", "panic_in_drop", Offline, Crash("SIGABRT")),
        rust("panic_with_a_bomb", "panic_with_a_bomb", Offline, Panicked("")),
        c("abort", "abort", Crash("SIGABRT")),
        c("segfault", "segv", Crash("SIGSEGV")),
        c("stack_overflow", "stack", Crash("SIGABRT, stack overflow")),
        rust("stack_overflow_in_rust", "overflow", Offline, Crash("SIGABRT, stack overflow")),
        c("infinite_loop", "loop", TimedOut),
        c("sleep_for_ever", "sleep", TimedOut),
        c("deaf_to_signals", "deafen", TimedOut),
        c("fork_bomb", "fork_bomb", Failed("0 of 200 processes, EPERM")),
        c("thread_bomb", "thread_bomb", Failed("fewer than 400 threads, EAGAIN")),
        c("memory_bomb", "memory_bomb", OutOfMemory),
        rust("memory_bomb_in_rust", "huge", Offline, OutOfMemory),
        c("disk_bomb_of_many_files", "many_files", Failed("fewer than 20000 files, ENOSPC")),
        c("disk_bomb_of_large_files", "full_disk", Failed("at most 64 MiB, ENOSPC")),
        c("disk_bomb_of_one_file", "one_large_file", FileTooLarge),
        c("stdout_flood", "flood_stdout", Zeros),
        c("stderr_flood", "flood_stderr", Zeros),
        c("exit_0_early", "exit0", Exit(0)),
        loaded("exit_in_a_constructor", "exit_at_load.so", Exit(3)),
        c("exec_of_a_shell", "exec /bin/sh", Zeros),
        loaded("exec_in_a_constructor", "exec_at_load.so", Zeros),
        c("daemon_that_holds_the_pipe", "daemon", Exit(0)),
        made("servers", |g| format!("serve {}", g.own("socket")), Failed("0 of 4 sockets, EPERM")),
        c("tcp_client", "tcp 9", Zeros),
        c("udp_client", "udp 9", Zeros),
        made("unix_client", |g| format!("unix {}", g.own("listener")), Zeros).quiet(),
        made("abstract_client", |g| format!("abstract {}", g.own("")), Zeros).quiet(),
        made("reads_the_references", |g| g.steal(&g.references()), Failed("0 stolen")),
        made(
            "reads_etc_shadow",
            |g| g.steal(&["/etc/shadow".into(), "/etc/passwd".into()]),
            Failed("0 stolen"),
        ),
        made("reads_the_home_folder", |g| g.steal(&g.home()), Failed("0 stolen")),
        made("reads_another_submission", |g| g.steal(&g.others()), Failed("0 stolen")),
        made("reads_proc_of_others", |g| g.steal(&g.proc_of_others()), Failed("0 stolen")),
        made("reads_the_results", |g| g.steal(&[g.own("results/report.json")]), Failed("0 stolen")),
        made(
            "writes_to_the_results",
            |g| format!("deface {} {}", g.own("results/report.json"), g.own("results/new")),
            Failed("0 written"),
        ),
        c(
            "writes_to_its_own_orders",
            "deface /job/job.json /job/input /scene/0/s.toml /plugin/fault.so /job/new",
            Failed("0 written"),
        ),
        c("kills_its_parent", "kill_parent", Failed("-1, EPERM")),
        c("ptrace", "trace", Failed("-1, EPERM")),
        c("changes_limits", "limits", Failed("0 changed, EPERM")),
        c("closes_the_result_channel", "close_all", Zeros),
        c("cuts_the_result_channel", "truncate", Rejected("cut the file short")).alone(),
        c("forges_answers", "forge_answers", Anything).alone(),
        c("forges_that_it_never_began", "forge_no_start", Ours).alone(),
        c("forges_that_it_was_not_confined", "forge_not_confined", Ours).alone(),
        c("forges_a_bug_of_ours", "forge_bug", Ours).alone(),
        c("unknown_status", "status", Failed("the plugin answered with the unknown status 77")),
        c("endless_message", "long_message", Failed("\0\0")),
        c("reports_a_lost_device", "lost_device", NoAdapter),
        c("reports_a_lost_device_in_words", "lost_in_words", Failed("the graphics device")),
        c("exits_with_75", "exit75", Exit(75)),
        c("writes_past_its_buffer", "past_end", Crash("SIGSEGV")),
        c("writes_before_its_buffer", "before_start", Rejected("before the start")),
        c("writes_from_a_leftover_thread", "late_writer", Anything),
        c("the_same_everywhere", "flat", Anything),
        c("nan", "nan", NotFinite),
        c("infinity", "infinite", NotFinite),
        loaded("wrong_size", "WRONG_SIZE.so", Rejected("found 64")),
        loaded("wrong_version", "WRONG_VERSION.so", Rejected("found 77")),
        loaded("wrong_magic", "WRONG_MAGIC.so", Rejected("0x1122334455667788")),
        loaded("null_entry", "NULL_ENTRY.so", Rejected("null")),
        c("null_scene", "null_scene", Failed("the plugin answered that it made a scene")),
        loaded("no_library", "text.so", Rejected("text.so")),
        c("changes_the_locale", "locale", Zeros),
        c("changes_the_rounding_mode", "rounding", Zeros),
        c("changes_the_current_folder", "folder", Zeros),
        made(
            "loads_the_reference",
            |g| format!("load {}", g.reference().join(" ")),
            Failed("0 loaded"),
        ),
        made(
            "looks_for_reference_shaders",
            |g| format!("look_for {}", g.shader_line()),
            Failed("0 found"),
        )
        .quiet(),
        made(
            "looks_for_what_the_grader_knows",
            |g| format!("look_for_lines {}", g.graders_lines().join("|")),
            Failed("0 found"),
        )
        .quiet(),
        c("asks_where_its_program_lies", "own_names", Failed("file /proc/self/fd/")),
        c("locks_files_that_others_use", "lock_files", Failed("0 locked, EPERM")),
        Plugin {
            asked: RealtimeWithStages,
            control: false,
            ..made(
                "keeps_stages_it_was_given",
                |g| format!("keep {}", g.own("results/kept")),
                Zeros,
            )
        },
        rust("device_loop", "device_loop", Realtime, TimedOut),
        rust("device_out_of_memory", "device_memory", Realtime, Failed("the graphics device")),
        rust("shader_that_does_not_compile", "shader", Realtime, Failed("")),
        c("injections", "inject", Failed("=HYPERLINK")),
    ]
}

impl Plugin {
    /// One that cannot be told from failure by its answer.
    fn quiet(self) -> Self {
        Self { control: false, ..self }
    }

    /// One that spoils its other answers as well.
    fn alone(self) -> Self {
        Self { around: false, ..self }
    }
}
