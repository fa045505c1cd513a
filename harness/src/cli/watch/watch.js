"use strict";
/* The page of `umbra watch`: says what the last save is at, and loads the report again when it is there. */
const report = document.getElementById("report");
const mark = document.getElementById("mark");
const status = document.getElementById("status");
const NAMES = { running: "Checking", done: "Nothing is wrong", unready: "Not ready to submit", lost: "Points are missing", refused: "Does not compile", failed: "No report" };
const EARLIER = {
  nothing: "The report below is of an earlier save.",
  offline: "The report below is of an earlier save. Shaders alone changed since: its offline results hold, and are run again.",
};
/** After so many seconds at one thing, how long it takes is shown; after so many, that it may be a hang. */
const SLOW_S = 3, HANG_S = 20;
let reports = -1;
let begun = null;

/** Says how long it is at what the status says; nobody reads it aloud every second. */
function tellTime() {
  const seconds = begun === null ? 0 : Math.round((performance.now() - begun) / 1000);
  const hangs = seconds >= HANG_S ? ": an endless loop is ended when its CPU time is used up" : "";
  if (seconds >= SLOW_S) status.dataset.time = ` (for ${seconds} s${hangs})`;
  else delete status.dataset.time;
}
setInterval(tellTime, 1000);

function show({ stage, message, verdict, reports: count, libraries, fresh, holds }) {
  document.body.className = stage;
  const words = `${NAMES[stage]}: ${message}`;
  if (stage !== "running") begun = null;
  else if (begun === null || status.textContent !== words) begun = performance.now();
  status.textContent = words;
  tellTime();
  document.title = `${{ running: "checking …", failed: "no report" }[stage] ?? verdict} - umbra watch`;
  tellLive({ stage, libraries, fresh });
  mark.hidden = count === 0 || holds === "all";
  mark.textContent = EARLIER[holds] ?? "";
  if (count === reports) return;
  reports = count;
  if (count > 0) reload();
}

/** Whether the page below shows a case of images that is still there. */
function showsCase() {
  const manifest = report.contentDocument?.getElementById("manifest");
  if (!manifest) return false;
  const wanted = new URLSearchParams(report.contentWindow.location.hash.slice(1)).get("case");
  return JSON.parse(manifest.textContent).cases.some(({ id }) => id === wanted);
}

/** Loads again what the reader has open: the viewer as its address says, the report where they are in it, the folded
    parts as they are. */
function reload() {
  const page = report.contentWindow;
  if (report.contentDocument?.getElementById("manifest")) {
    report.addEventListener("load", () => showsCase() || loadReport(), { once: true });
    page.location.reload();
    return;
  }
  let place = 0;
  let open = [];
  try {
    place = page.scrollY;
    open = [...page.document.querySelectorAll("details[open] > summary")].map((summary) => summary.textContent);
  } catch {
    // Nothing was loaded yet.
  }
  report.addEventListener("load", () => {
    for (const summary of report.contentDocument.querySelectorAll("details > summary")) {
      if (open.includes(summary.textContent)) summary.parentElement.open = true;
    }
    report.contentWindow.scrollTo(0, place);
  }, { once: true });
  loadReport();
}

function loadReport() {
  report.src = `report/${report.dataset.page}`;
}

const events = new EventSource("events");
events.addEventListener("message", (event) => show(JSON.parse(event.data)));
events.addEventListener("error", () => {
  document.body.className = "failed";
  document.title = "ended - umbra watch";
  begun = null;
  tellTime();
  status.textContent = "umbra watch has ended";
});
