//! The live view of `umbra watch`: a scene that the mouse turns, drawn by the student's own code.
//!
//! ```text
//! browser -- GET frame?path=realtime&scene=..&camera=.. --> LiveView --> one worker that stays (worker::LiveWorker)
//! browser -- GET frame?path=offline&spp=1, 4, 16 .. ------> LiveView --> one worker per picture (Supervisor::run_job)
//! ```
//! **Who draws.** The library of the last save that compiled. The check compiles it anyway and leaves it for the watch
//! (`umbra check --keep-plugin`, a hidden option). This process never loads it: a confined worker does.
//!
//! **Realtime.** One worker loads library and scene once, opens the pass, and draws a frame for each camera it is sent.
//! Another scene, shadow map or library means another worker. Nobody pushes frames: the browser asks for the next
//! picture when it has one to spare, with the camera of that moment, so that a slow renderer skips and never lags.
//!
//! **Offline.** A renderer takes its camera from a scene file. So each picture is a job with a scene file of its own:
//! the scene's, with the camera replaced, beside a link to the folder of its mesh. A camera that moved ends the job.
//!
//! **Pixels** reach the browser as 16-bit floats; exposure is applied there, without asking anybody.
//!
//! **What goes wrong** is the answer to the question: a text, shown in the picture's place. The page asks again after
//! the next save. A frame may take so much CPU time, or stand still so long, and then its worker is ended.
//!
//! **Idle.** A worker that is asked nothing for a while ends. Then a watch has no process but itself.
