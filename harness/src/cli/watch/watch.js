"use strict";
/* The page of `umbra watch`: says what the last save is at, and loads the report again when it is there. */
/** The newest report of each look. */
const frames = { first: document.getElementById("first"), whole: document.getElementById("report") };
const mark = document.getElementById("mark");
const status = document.getElementById("status");
const NAMES = { running: "Checking", done: "Done", failed: "No report" };
const EARLIER = {
  past: "The report below is of an earlier save.",
  offline: "The report below is of an earlier save. Shaders alone changed since: its offline results hold, and are run again.",
};
let reports = -1;

function show({ stage, message, look, reports: count, libraries, fresh, whole }) {
  document.body.className = stage;
  status.textContent = `${NAMES[stage]}: ${message}`;
  tellLive({ libraries, fresh });
  // A first look takes the place of an older report, of which nothing need hold any more.
  frames.first.hidden = look !== "first" || whole === "now";
  frames.whole.hidden = look === "first" && whole === "past";
  mark.hidden = frames.whole.hidden || count === 0 || whole === "now";
  mark.textContent = EARLIER[whole] ?? "";
  if (count === reports) return;
  reports = count;
  if (count > 0) reload(frames[look], look);
}

/** Loads the report where the reader is in it, the folded parts as they are. */
function reload(frame, look) {
  const page = frame.contentWindow;
  let place = 0;
  let open = [];
  try {
    place = page.scrollY;
    open = [...page.document.querySelectorAll("details[open] > summary")].map((summary) => summary.textContent);
  } catch {
    // Nothing was loaded yet.
  }
  frame.addEventListener("load", () => {
    for (const summary of frame.contentDocument.querySelectorAll("details > summary")) {
      if (open.includes(summary.textContent)) summary.parentElement.open = true;
    }
    frame.contentWindow.scrollTo(0, place);
  }, { once: true });
  frame.src = `${look}/${frames.whole.dataset.page}`;
}

const events = new EventSource("events");
events.addEventListener("message", (event) => show(JSON.parse(event.data)));
events.addEventListener("error", () => {
  document.body.className = "failed";
  status.textContent = "umbra watch has ended";
});
