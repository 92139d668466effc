// Generated from the schemas in app/web by `python -m tests.app.web.message_types`: do not edit.
/** Work in the background: recordings done of all, those that cannot be read, and what happened to a camera. */
export type AnalysisState = { total: number; done: number; is_working: boolean; failures: Record<string, string>; camera_notice: CameraNotice | null };
/** Declaration of one bias. */
export type BiasRange = { low: number; high: number; default: number; help: string };
/** Biases to simulate the scene with, or to write to a file. */
export type BiasRequest = { biases: Record<string, number> };
/** Biases of a recording. */
export type BiasState = { values: Record<string, number>; known: boolean; locked: string | null; calibrated: boolean; ranges: Record<string, BiasRange>; swept: SweptBias[]; of_camera: boolean };
/** The points of a sweep so far: over one bias (`name`), or of recordings whose biases are known. */
export type BiasSweep = { name: string | null; total: number; points: BiasSweepPoint[]; proposal: string | null };
/** Progress of a bias sweep. */
export type BiasSweepMessage = { kind: "bias_sweep"; state: "running" | "done" | "cancelled" | "failed"; error: string | null; content: BiasSweep | null };
/** Event rates with one setting, of the whole sensor; only `error` where a recording could not be used. */
export type BiasSweepPoint = { value: number | null; recording: string | null; biases: Record<string, number>; error: string | null; ball_on_hz: number | null; ball_off_hz: number | null; noise_on_hz: number | null; noise_off_hz: number | null };
/** Sweep a bias, all others as given; for a real recording, whose own biases these may be, measure the folder. */
export type BiasSweepRequest = { biases: Record<string, number>; is_known?: boolean; name: string; points?: number };
/** A .bias file. */
export type BiasText = { text: string };
/** Biases read from a file. */
export type BiasValues = { biases: Record<string, number> };
/** Progress of a re-simulation. */
export type BiasesMessage = { kind: "biases"; state: "running" | "done" | "cancelled" | "failed"; error: string | null; content: Resimulation | null };
/** Incident of a running camera: its kind, of which the page has the words (`camera_...`), and details. */
export type CameraNotice = { kind: "unplugged" | "back" | "clock" | "behind" | "biases" | "recording" | "spins" | "stall" | "size" | "lost" | "ended"; text: string };
/** Cancel the job of a kind. */
export type CancelRequest = { kind: "sweep" | "optimization" | "biases" | "bias_sweep" };
/** Anything that the page offers by name. */
export type Choice = { name: string; label: string; help: string };
/** One shot of a session: its columns, and what follows from them. */
export type CoachShot = { session: string; id: number; revision: number; recording: string; shot: number; start_us: number; end_us: number; recorded_s: number; began_by: string; ended_by: string; speed_m_s: number | null; spin_rps: number | null; spin_std_rps: number | null; axis_std_deg: number | null; topspin_rps: number | null; sidespin_rps: number | null; corkscrew_rps: number | null; told_by: "logo" | "rhythm" | "flight" | null; reason: string | null; has_picture: boolean; player: string | null; wing: string | null; stroke: string | null; drill: string | null; marked: boolean; deleted: boolean; kind: string[]; effect: number | null; effect_word: "spinny" | "neutral" | "speedy" | null; confidence: "sure" | "good" | "rough" | null; clock_hours: number | null; corkscrew_share: number | null };
/** Declaration of one parameter, as its control needs it; `is_setup` where it belongs to the set-up. */
export type ControlInfo = { name: string; label: string; kind: string; default: any; optional: boolean; unit: string; low: number | null; high: number | null; step: number | null; choices: string[]; help: string; allowed: string; scale: "linear" | "logarithmic" | "cubic" | "none"; is_setup: boolean };
/** Answer without content. */
export type Done = {  };
/** The name that opens a dropped file. */
export type Dropped = { name: string };
/** Estimate of one method for one shot, ready for JSON; None for what is not known. */
export type EstimateMetrics = { status: string; reason: string | null; magnitude_rps: number | null; magnitude_std_rps: number | null; axis: number[] | null; axis_std_deg: number | null; error_rps: number | null; error_deg: number | null; error_share: number | null };
/** Event rate of the whole recording: counts of bins of equal length, and their edges. */
export type EventRate = { counts: number[]; edges_us: number[] };
/** The smoothed flight, metres. */
export type FlightPath = { frame: "table" | "hitter"; t_us: number[]; points_m: [number, number, number][]; net_clearance_m: number | null; height_std_m: number | null; landing_m: [number, number] | null };
/** Subfolders and recordings of `folder`, a path within the folder `root` of the machine. */
export type FolderListing = { root: string; folder: string; folders: string[]; recordings: ListedRecording[] };
/** Result of the proposal on clips that it was not tuned on. */
export type HeldOut = { clips: number; before: number; after: number; objection: string | null };
/** Revision after a change. */
export type Kept = { revision: number };
/** A labelled place of the ball: scene time, silhouette, its error, number of the flight from 1. */
export type Label = { t_us: number; x_px: number; y_px: number; radius_px: number; std_px: number; ball: number; state: "detected" | "accepted" | "moved" };
/** Put labels in the place of `removed` others from number `first` on, which counts from 0. */
export type LabelChangeRequest = { version: string; first: number; removed: number; labels: Label[] };
/** Version of the labels after a change. */
export type LabelVersion = { version: string };
/** All labels of the recording, in order of time, flight by flight; a change names the `version` that it is of. */
export type Labels = { path: string; version: string; labels: Label[] };
/** Places where shots bounced, by id: metres along the table with the flight from the net, and to the left. */
export type Landings = { landings: Record<string, [number, number]> };
/** A recording of a folder, or a dropped one; `name` opens it. */
export type ListedRecording = { name: string; size_bytes: number };
/** Note a text beside the recording, at the time of so many seconds ago. */
export type LiveMarkerRequest = { text: string; seconds_ago: number };
/** Have the running camera's stages go on with these parameters. */
export type LiveParametersRequest = { parameters: Record<string, Record<string, any>> };
/** Recording of the camera under way: its present file, and numbers of events and markers. */
export type LiveRecording = { file: string; events: number; markers: number };
/** Begin a recording of the camera, or end the one under way. */
export type LiveRecordingRequest = { is_on: boolean };
/** State of one second, `t_s` after the start; latencies and rates are None where there is nothing to measure. */
export type LiveSecond = { t_s: number; rate_mev_s: number; p50_ms: number | null; p99_ms: number | null; announced_ms: number | null; final_ms: number | null; dropped: number; outside: number; late: number; skipped: number; backlog_ms: number; spin_backlog_ms: number; noise_on_hz: number | null; noise_off_hz: number | null; ball_on_hz: number | null; ball_off_hz: number | null };
/** A shot that has ended, in words; `recording` has its events as soon as its spin is final. */
export type LiveShotRow = { text: string; is_final: boolean; recording: string | null };
/** Running camera as the page shows it; `fault` is why no events come from it at present, in words. */
export type LiveView = { camera: string; is_running: boolean; fault: string | null; kept_s: number; seconds: LiveSecond[]; shots: LiveShotRow[]; notices: NumberedNotice[]; recording: LiveRecording | null };
/** Recording of the last seconds: its name in the folder. */
export type LiveWindow = { recording: string };
/** Save the last seconds as a recording of its own. */
export type LiveWindowRequest = { seconds: number };
/** A spin method with its colour, as CSS. */
export type MethodInfo = { name: string; label: string; help: string; colour: string };
/** A metric of a run, shot or estimate: field name, label, unit (% for a share of 0 to 1) and explanation. */
export type MetricInfo = { name: string; label: string; unit: string; help: string };
/** Names of a shot; None clears one. */
export type Names = { player: string | null; wing: string | null; stroke: string | null; drill: string | null };
/** Set names, marks, or that shots are deleted; what is not given stays. */
export type NamesRequest = { ids: number[]; values: Record<string, string | boolean | null> };
/** Incident of a running camera in words, with its number from the start: the same may happen again. */
export type NumberedNotice = { number: number; text: string };
/** Open a session on a recording of the folder; None for the one the program was started with. */
export type OpenRequest = { recording?: string | null };
/** Everything that the page needs to know at first; without `tools` it shows the viewer alone, `tab` in front. */
export type Opening = { session: string; viewer_version: string; tools: boolean; tab: string; followed: number | null; recording: RecordingDescription; sections: SectionInfo[]; stages: Choice[]; methods: MethodInfo[]; run_metrics: MetricInfo[]; shot_metrics: MetricInfo[]; estimate_metrics: MetricInfo[]; tabs: Choice[]; exports: Choice[]; objectives: Choice[]; suggested: string[]; colours: Record<string, string>; presets: Record<string, Record<string, Record<string, any>>>; renamed: Record<string, string>; biases: BiasState; is_live: boolean; has_labels: boolean; shows_labels: boolean };
/** The trials of an optimization so far. */
export type Optimization = { objective: string; total: number; clips: number; trials: Trial[]; best: number | null; values: Record<string, boolean | number | string | null>; held_out: HeldOut | null; skipped: string[] };
/** Progress of an optimization. */
export type OptimizationMessage = { kind: "optimization"; state: "running" | "done" | "cancelled" | "failed"; error: string | null; content: Optimization | null };
/** Optimize some parameters for the clip, or for several clips of the recording, or for several recordings. */
export type OptimizationRequest = { parameters: Record<string, Record<string, any>>; start_us?: number | null; end_us?: number | null; names: string[]; objective: string; trials?: number; clips_us?: number[][]; recordings?: string[] };
/** The points of a sweep so far. */
export type ParameterSweep = { name: string; total: number; points: SweepPoint[] };
/** An .rrd picture that is ready to be fetched. */
export type Picture = { id: string; size_bytes: number; start_us: number; end_us: number; opening_us: number; seen_shots: [number, number][][] };
/** Parameters read from a preset, and notices of former names in it. */
export type PresetValues = { parameters: Record<string, Record<string, any>>; notices: string[] };
/** Preview of a run at a time, before its picture: the address of a PNG, and the answer in words. */
export type PreviewMessage = { kind: "preview"; serial: number; t_us: number; picture: string; words: string };
/** The opened recording, worked on shot by shot if it is long; `clip_us` is the first clip, [start, end). */
export type RecordingDescription = { name: string; events: number; width_px: number; height_px: number; start_us: number; end_us: number; longest_us: number; is_long: boolean; clip_us: [number, number]; margin_us: number; has_truth: boolean; warnings: string[]; rate: EventRate };
/** Content of a recording, or `error`; without `shots` where it is too long to be searched for them in passing. */
export type RecordingSummary = { events: number | null; duration_us: number | null; picture: string | null; shots: number | null; spin: string | null; error: string | null };
/** The recording after its scene was simulated again. */
export type Reopened = { recording: RecordingDescription; biases: BiasState };
/** Progress of a re-simulation with these biases, as the share done. */
export type Resimulation = { share: number; biases: Record<string, number> };
/** Progress or result of a run request. */
export type RunMessage = { kind: "run"; serial: number; state: "loading" | "computing" | "drawing" | "partial" | "done" | "failed"; share: number; stages_ms: Record<string, number>; total_ms: number; error: string | null; picture: Picture | null; metrics: RunMetrics | null; costs_ms: Record<string, number> | null; pinned_metrics: RunMetrics | null; pinned_costs_ms: Record<string, number> | null; differences: [string, any, any][]; highs: Record<string, number> };
/** Metrics of a run over all its shots. */
export type RunMetrics = { ticks: number; tracked_share: number | null; residual_px: number | null; jitter_px: number | null; logo_events: number; shots: ShotMetrics[]; no_shot_reason: string | null; up_doubt: string | null };
/** Run a clip with `parameters`, beside those pinned as A; the request with the highest serial is the newest. */
export type RunRequest = { serial: number; parameters: Record<string, Record<string, any>>; pinned?: Record<string, Record<string, any>> | null; start_us: number; end_us: number; playhead_us?: number | null; interactive?: boolean; has_preview?: boolean; followed?: number | null };
/** A group of controls; `terms` of the glossary explain it, `is_open` where it is unfolded at first. */
export type SectionInfo = { title: string; terms: string[]; is_open: boolean; controls: ControlInfo[] };
/** Statistics of the spin of a series of shots; None for what too few shots tell. */
export type SeriesStatistics = { count: number; unseen: number; median_rps: number | null; median_std_rps: number | null; best_rps: number | null; best_id: number | null; spread_rps: number | null; median_speed_m_s: number | null; ellipse: [number, number][] | null; trend: "rose" | "fell" | "unclear" | "too_few"; change_rps: number | null; change_std_rps: number | null };
/** Sessions that are open. */
export type SessionNames = { sessions: string[] };
/** The shots of a session that have changed since a revision. */
export type SessionShots = { revision: number; shots: CoachShot[]; analysis: AnalysisState; now: Names };
/** Parameters, and the clip when it is not the first one of the recording. */
export type SettingsRequest = { parameters: Record<string, Record<string, any>>; start_us?: number | null; end_us?: number | null };
/** Drawn details of a shot; directions in the camera frame, `texture` a PNG in base64. */
export type ShotDetail = { shot: CoachShot; spin_rps: number[] | null; reference_us: number; hitter: number[][] | null; texture: string | null; proof: SpinProofPoints | null; flight: FlightPath | null };
/** One shot with the estimate of every method. */
export type ShotMetrics = { start_us: number; end_us: number; logo_events: number; speed_m_s: number | null; radius_px: number | null; best: string | null; best_reason: string | null; kind: string | null; sentence: string; spin: Record<string, EstimateMetrics>; witnesses: Record<string, WitnessMetrics> };
/** Shots of a long recording found so far, [start, end) in us, and the share of it that was searched. */
export type ShotsMessage = { kind: "shots"; share: number; shots: [number, number][]; error: string | null };
/** The logo at two instants, and the first turned to the second: places on the disc as the camera sees it. */
export type SpinProofPoints = { first_us: number; second_us: number; first: number[][]; second: number[][]; turned: number[][] };
/** Statistics of series of shots, by their names, and how their middles compare (`compared`). */
export type Statistics = { series: Record<string, SeriesStatistics>; order: string[]; is_clear: boolean };
/** Statistics of series by their names: ids of shots by session; see `series_statistics` for `since_s`. */
export type StatisticsRequest = { series: Record<string, Record<string, number[]>>; since_s?: number | null };
/** Progress of a parameter sweep. */
export type SweepMessage = { kind: "sweep"; state: "running" | "done" | "cancelled" | "failed"; error: string | null; content: ParameterSweep | null };
/** Metrics of a run with one value; only `error` where the value does not go with the others. */
export type SweepPoint = { value: boolean | number | string; error: string | null; tracked_share: number | null; residual_px: number | null; jitter_px: number | null; logo_events: number | null; best: string | null; spin: Record<string, EstimateMetrics> };
/** Sweep one parameter; without low and high over its whole range. */
export type SweepRequest = { parameters: Record<string, Record<string, any>>; start_us?: number | null; end_us?: number | null; name: string; low?: number | null; high?: number | null; points?: number };
/** Subject of one sweep: one bias, or several together. */
export type SweptBias = { name: string; label: string; biases: string[] };
/** Recordings that the table can be marked in, and the present marks. */
export type TableMarks = { recordings: string[]; recording: string | null; corners_px: [number, number][] | null; height_m: number | null; off_px: number | null };
/** Corners of the table in the picture of a recording, columns and rows in order round the table. */
export type TableRequest = { recording: string; corners_px: number[][] };
/** A preset (TOML) or a .bias file to read. */
export type TextRequest = { text: string };
/** One setting, over all clips that are tuned on. */
export type Trial = { cost: number; answers: number; logo_events: number; objection: string | null };
/** Evidence of one witness of the combined answer; None for what it does not tell. */
export type WitnessMetrics = { magnitude_rps: number | null; magnitude_std_rps: number | null; odds: string };
/** Settings as a preset and as a command line; `needs` names a file that the command reads. */
export type WrittenSettings = { toml: string; command: string; needs: string | null };
/** Messages of the server by their kind. */
export interface ServerMessages {
  "run": RunMessage;
  "preview": PreviewMessage;
  "shots": ShotsMessage;
  "sweep": SweepMessage;
  "optimization": OptimizationMessage;
  "biases": BiasesMessage;
  "bias_sweep": BiasSweepMessage;
}
/** POST requests of a session: what is sent and answered. */
export interface SessionPosts {
  "bias_sweep": { sent: BiasSweepRequest; answered: Done };
  "biases": { sent: BiasRequest; answered: Done };
  "cancel": { sent: CancelRequest; answered: Done };
  "find_ball": { sent: SettingsRequest; answered: Record<string, number> };
  "labels": { sent: LabelChangeRequest; answered: LabelVersion };
  "optimization": { sent: OptimizationRequest; answered: Done };
  "presets/read": { sent: TextRequest; answered: PresetValues };
  "presets/write": { sent: SettingsRequest; answered: WrittenSettings };
  "run": { sent: RunRequest; answered: Done };
  "sweep": { sent: SweepRequest; answered: Done };
}
/** GET requests of a session: what is sent and answered. */
export interface SessionGets {
  "labels": { sent: null; answered: Labels };
  "preview": { sent: null; answered: PreviewMessage };
  "recording": { sent: null; answered: Reopened };
}
/** POST requests: what is sent and answered. */
export interface Posts {
  "/api/biases/read": { sent: TextRequest; answered: BiasValues };
  "/api/biases/write": { sent: BiasRequest; answered: BiasText };
  "/api/drop": { sent: null; answered: Dropped };
  "/api/live/marker": { sent: LiveMarkerRequest; answered: LiveView };
  "/api/live/parameters": { sent: LiveParametersRequest; answered: Done };
  "/api/live/recording": { sent: LiveRecordingRequest; answered: LiveView };
  "/api/live/window": { sent: LiveWindowRequest; answered: LiveWindow };
  "/api/sessions": { sent: OpenRequest; answered: Opening };
}
/** GET requests: what is sent and answered. */
export interface Gets {
  "/api/folder": { sent: null; answered: FolderListing };
  "/api/live/view": { sent: null; answered: LiveView };
  "/api/openable": { sent: null; answered: Done };
  "/api/summary": { sent: null; answered: RecordingSummary };
}
/** POST requests of a session: what is sent and answered. */
export interface CoachPosts {
  "names": { sent: NamesRequest; answered: Kept };
  "now": { sent: Names; answered: Kept };
  "table": { sent: TableRequest; answered: TableMarks };
}
/** GET requests of a session: what is sent and answered. */
export interface CoachGets {
  "landings": { sent: null; answered: Landings };
  "shots": { sent: null; answered: SessionShots };
  "shots/{shot_id}": { sent: null; answered: ShotDetail };
  "table": { sent: null; answered: TableMarks };
}
