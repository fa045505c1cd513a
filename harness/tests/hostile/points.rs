//! What hostile plugins are worth: each goes through grading, and must earn nothing.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use umbra::assignment::Assignment;
use umbra::evidence::{Evidence, Verdict};
use umbra::grading::{Conditions, Grading, Record, RenderPath, Stages, Student};
use umbra::report::{self, BatchReport, Look, SubmissionReport};
use umbra::rubric::{self, PartGrade};
use umbra::store::Store;
use umbra::worker::{Adapter, AdapterKind};

use crate::fixture::{Fixture, workspace};
use crate::plugins;

/// The scene that is graded, with its bonus: the worst scene counts, so that one alone can only be kinder.
const SCENE: &str = "cbox";
const FILM: [u32; 2] = [64, 48];

/// The points of every plugin that is loaded and asked, by name; none where it could not be judged.
pub fn all(fixture: &Fixture) -> anyhow::Result<Vec<(&'static str, Option<f64>)>> {
    let mut assignment = Assignment::load(workspace())?;
    assignment.scenes.retain(|scene| scene.name == SCENE);
    for scene in &mut assignment.scenes {
        scene.submitted = None;
        scene.film = Some(FILM);
    }
    assignment.limits.run.wall_s = 1.0;
    assignment.limits.budget.still_s = 5.0;
    assignment.limits.run.cpu_s = 1;
    assignment.limits.budget.cpu_s = 3.0;
    assignment.limits.run.memory_mib = 1024;
    assignment.limits.run.output_kib = 256;
    let library = workspace().join("target/release/libreference_impl.so");
    let store = Store {
        assignment: &assignment,
        reference: Some(library),
        supervisor: &fixture.supervisor,
        threads: 2,
        progress: &|_| (),
    };
    let never = AtomicBool::new(false);
    let adapter = Adapter { kind: AdapterKind::Software, name: String::new() };
    let grading = Grading::prepare(&store, adapter, None, &never)?;
    // The template's stages: what is drawn is all that there is.
    let template = assignment.template();
    let stages = Stages::read(&template, &template);
    let plugins = plugins::all();
    let (next, earned) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        let grade = || -> anyhow::Result<()> {
            while let Some(plugin) = plugins.get(next.fetch_add(1, Ordering::Relaxed)) {
                let (library, options) = (fixture.path(plugin.library), plugin.options(fixture));
                let library = Path::new(&library);
                let (evidence, _) =
                    grading.plugin(library, &options, 1, &stages, &RenderPath::ALL)?;
                let grade = rubric::grade(&assignment.rules, &evidence);
                let points = (grade.points == grade.points_max).then_some(grade.points);
                for part in grade.parts.iter().filter(|part| part.points_max > 0.0) {
                    let PartGrade { id, points, points_max, reason, .. } = part;
                    eprintln!("{}: {id}: {points} to {points_max}: {reason}", plugin.name);
                }
                if plugin.name == "injections" {
                    let record = record(plugin.name, evidence);
                    check_reports(&BatchReport::new(
                        &assignment,
                        None,
                        vec![SubmissionReport { record, grade, standing: Default::default() }],
                    ))?;
                }
                if let Ok(mut earned) = earned.lock() {
                    earned.push((plugin.name, points));
                }
            }
            Ok(())
        };
        // Most wait for a limit: twice as many as cores.
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(grade)).collect();
        threads.into_iter().try_for_each(|thread| thread.join().expect("no panic"))
    })?;
    believe_the_machine(&assignment, grading, fixture, &stages)?;
    Ok(earned.into_inner().unwrap_or_default())
}

/// A lost device is believed when the reference fails as well: nothing is graded, nothing lost.
fn believe_the_machine(
    assignment: &Assignment,
    mut grading: Grading,
    fixture: &Fixture,
    stages: &Stages,
) -> anyhow::Result<()> {
    grading.reference = Some(fixture.path("NULL_ENTRY.so").into());
    let library = fixture.path("fault.so");
    let (library, action) = (Path::new(&library), "lost_device");
    let (evidence, _) = grading.plugin(library, action, 1, stages, &RenderPath::ALL)?;
    let grade = rubric::grade(&assignment.rules, &evidence);
    let proofs = evidence.checks.iter().filter(|check| check.id.name().starts_with("image."));
    anyhow::ensure!(
        grade.points == 0.0
            && grade.points_max >= 55.0
            && proofs.clone().count() > 0
            && proofs.clone().all(|check| check.verdict == Verdict::NotRun)
            && grade.remarks.iter().any(|remark| remark.starts_with("ungraded in part")),
        "a fault that the reference shares is not believed: {grade:#?}"
    );
    Ok(())
}

fn record(name: &str, evidence: Evidence) -> Record {
    let hostile =
        evidence.checks.iter().map(|check| check.summary.as_str()).max_by_key(|s| s.len());
    // A summary holds the first line of what a plugin says; a name may hold all that a page acts on.
    let said = format!(
        "{}<script>alert(1)</script><img src=x onerror=alert(1)>",
        hostile.unwrap_or_default()
    );
    Record {
        name: said.clone(),
        slug: name.to_owned(),
        digest: String::new(),
        student: Student { first_name: said.clone(), last_name: said.clone(), id: said.clone() },
        findings: Vec::new(),
        diagnostics: said,
        evidence,
        diagnoses: Vec::new(),
        images: Vec::new(),
        sources: Vec::new(),
        views: Vec::new(),
        error_maps: Vec::new(),
        stages: Vec::new(),
        conditions: Conditions::default(),
    }
}

/// Writes all reports and looks for what a terminal, a browser, a spreadsheet or a parser would
/// act on.
fn check_reports(report: &BatchReport) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    report::write(folder.path(), report)?;
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name));
    let slug = &report.entries[0].record.slug;
    let pages = [read(report::HTML_FILE)?, read(&format!("{slug}/{}", report::HTML_FILE))?];
    let csv = read(report::CSV_FILE)?;
    let look = Look { width: 120, colors: false };
    let texts = [
        report::text_table(report, 120, false)?,
        report::text_detail(report, &report.entries[0], look, true),
        report::text_detail(report, &report.entries[0], look, false),
        read(report::JSON_FILE)?,
        csv.clone(),
        pages.concat(),
    ];
    anyhow::ensure!(texts.iter().any(|text| text.contains("onerror")), "the words are nowhere");
    for text in &texts {
        let acts = |c: char| {
            (c.is_control() && c != '\n')
                || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{fffe}' | '\u{ffff}')
        };
        anyhow::ensure!(!text.chars().any(acts), "a report holds what acts: {text:?}");
    }
    for page in &pages {
        for tag in ["<script>alert", "<img src=x", "</td></tr>]]"] {
            anyhow::ensure!(!page.contains(tag), "a page holds {tag}");
        }
    }
    for row in csv.lines() {
        let formula = |cell: &str| {
            let cell = cell.trim_start_matches('"');
            cell.starts_with(['=', '@']) || (cell.starts_with(['+', '-']) && cell.len() > 8)
        };
        anyhow::ensure!(!row.split(',').any(formula), "a cell is a formula: {row:?}");
    }
    Ok(())
}
