// The API's answers, as the pages read them: an interface here bears the name of its class in service/schemas and holds no
// other fields than that class (tests/service/dashboard/test_types.py). For the checks alone; browsers never load this file.

export type Quantiles = Record<string, number | null>;

/** A list's page; `next` is the cursor of the page after it. */
export interface ListPage<Item> {
  items: Item[];
  next: string | null;
}

// --- service/schemas/problem.py

export interface ProblemError {
  pointer: string;
  row: number | null;
  value: string;
  message: string;
}

// --- service/schemas/clutch.py

export interface GeometryIn {
  inner_diameter_mm: number;
  outer_diameter_mm: number;
  friction_faces: number;
  mean_radius_mm: number | null;
}

export interface EndOfLifeIn {
  cof_fraction: number;
  criteria: CriterionIn[];
}

export interface ClutchSummary {
  status: string;
  current: Current;
  remaining_cycles: Quantiles;
  at_least: number | null;
  ended: DeclaredEnd | null;
}

export interface LastRun {
  kind: string;
  cycles: number;
  at: string;
}

export interface Recent {
  last_run: LastRun;
  mean_cof: number[];
}

export interface LatestDiagnosis {
  verdict: string | null;
  causes: string[];
  adopted: boolean;
  earlier_life: boolean;
}

export interface ClutchState {
  name: "failure" | "out_of_specification" | "maintenance" | "check" | "normal";
  why: string;
}

export interface ClutchOut {
  clutch_id: string;
  geometry: GeometryIn;
  end_of_life: EndOfLifeIn;
  friction_material: string;
  reaction_plate: string;
  fluid: string;
  origin: string;
  archived: boolean;
  state: ClutchState;
  runs: number;
  held: number;
  summary: ClutchSummary | null;
  recent: Recent | null;
  diagnosis: LatestDiagnosis | null;
}

// --- service/schemas/fleet.py

export interface StateCounts {
  failure: number;
  out_of_specification: number;
  maintenance: number;
  check: number;
  normal: number;
}

export interface FleetTotals {
  all: number;
  held: number;
  states: StateCounts;
  scale_cycles: number;
}

// --- service/schemas/criteria.py

export interface CriterionIn {
  quantity: string;
  fraction: number | null;
  below: number | null;
  above: number | null;
  pressure_bar: number | null;
  speed_rpm: number | null;
  frequency_hz: number | null;
}

// --- service/schemas/life.py

export interface CriterionPlace extends CriterionIn {
  limit: number | null;
}

export interface Criterion extends CriterionPlace {
  threshold_mean_cof: number | null;
}

export interface CriterionValue {
  value: number | null;
  sd: number | null;
}

export interface CriterionOutcome extends CriterionPlace {
  current: CriterionValue;
  remaining_cycles: Quantiles;
  end_of_life_cycles: Quantiles;
  probability_of_reaching: number | null;
  probability_first: number;
}

export interface Current {
  mean_cof: number | null;
  mean_cof_sd: number | null;
  fraction_of_initial: number | null;
  health: number | null;
  measured_at_cycles: number | null;
}

export interface ModelName {
  name: string;
  effects: string[];
}

export interface CourseShare {
  name: "eq6" | "slowing" | "accelerating";
  probability: number;
  order: number | null;
}

export interface HeldRuns {
  count: number;
  remaining_cycles: Quantiles;
}

export interface DeclaredEnd {
  cycles: number;
  reason: string;
  run_id: string;
}

export interface RemainingLife {
  revision: number;
  as_of_cycles: number | null;
  runs_used: number;
  status: string;
  criterion: Criterion;
  current: Current;
  remaining_cycles: Quantiles;
  end_of_life_cycles: Quantiles;
  at_least: number | null;
  held_runs: HeldRuns | null;
  statement: string;
  probability_of_reaching: number | null;
  criteria: CriterionOutcome[];
  course: (CourseShare & { alternatives: CourseShare[] }) | null;
  back_cast: { held: number; of: number; widening: number } | null;
  ended_lives: number;
  ended: DeclaredEnd | null;
  horizon_cycles: number;
  model: ModelName;
  warnings: Warned[];
}

// --- service/schemas/programme.py

export interface PlannedLife {
  status: string;
  statement: string;
  remaining_cycles: Quantiles;
  recent_duty_cycles: Quantiles;
  remaining_blocks: Quantiles;
  end_of_life_at: Record<string, string | null> | null;
  warnings: Warned[];
}

// --- service/schemas/degradation.py

export interface Estimate {
  value: number;
  sd: number;
}

export interface Coefficients {
  initial: Estimate;
  change: Estimate;
  scale_cycles: Estimate;
}

export interface Measured {
  cycles: number[];
  value: number[];
  sd: number[];
}

export interface Trajectory {
  cycles: number[];
  median: number[];
  lower: number[];
  upper: number[];
}

export interface DegradationItem {
  quantity: string;
  pressure_bar: number | null;
  speed_rpm: number | null;
  frequency_hz: number | null;
  coefficients: Coefficients | null;
  eq6_probability: number | null;
  measured: Measured;
  trajectory: Trajectory;
}

export interface LinearLaw {
  intercept: number;
  slope_per_bar: number;
  covariance: number[][];
}

export interface AsymptoticLaw {
  asymptote: number;
  excess: number;
  decay_bar: number;
  covariance: number[][];
}

export interface PressureLawsOut {
  static_torque_nm: LinearLaw;
  coulomb_ratio: AsymptoticLaw;
  stribeck_velocity_m_s: LinearLaw;
  viscous_coefficient: LinearLaw;
}

export interface StribeckItem {
  run_id: string;
  cycles: number;
  fits: Fit[];
  pressure_laws: PressureLawsOut | null;
}

export interface LoopItem extends Loop {
  run_id: string;
  cycles: number;
}

export interface SeriesItem {
  cycles: number;
  run_id: string | null;
  pressure_bar: number | null;
  value: number | null;
  lower: number | null;
  upper: number | null;
}

// --- service/schemas/indicators.py and engagement.py

export interface IndicatorEstimate {
  value: number;
  sd: number;
}

export interface Indicators {
  stop_time_s: IndicatorEstimate | null;
  engagement_energy_kj: IndicatorEstimate | null;
  peak_power_kw: IndicatorEstimate | null;
  initial_cof: IndicatorEstimate | null;
  midpoint_cof: IndicatorEstimate | null;
  endpoint_cof: IndicatorEstimate | null;
  breakaway_cof: IndicatorEstimate | null;
  initial_cof_ratio: IndicatorEstimate | null;
  endpoint_cof_ratio: IndicatorEstimate | null;
  breakaway_cof_ratio: IndicatorEstimate | null;
  torque_rise: IndicatorEstimate | null;
}

export interface AllIndicators extends Indicators {
  normalised_duration: IndicatorEstimate | null;
  euclidean_distance: IndicatorEstimate | null;
  spectral_angle_rad: IndicatorEstimate | null;
}

export interface ReceivedEngagement {
  status: string;
  message: string;
  indicators: Indicators;
}

export interface MeasuredEngagement {
  run_id: string;
  cycles: number;
  indicators: AllIndicators;
}

export interface EngagementTrace {
  time_s: number[];
  pressure_bar: number[];
  speed_rpm: number[];
  torque_nm: number[];
}

export interface ModelledEngagement {
  channels: EngagementTrace;
  stop_time_s: number | null;
  torque_discrepancy: number;
  stop_time_difference_s: number | null;
  stop_time_difference_sd_s: number | null;
}

export interface ComparedEngagement {
  run_id: string;
  cycles: number;
  channels: EngagementTrace;
  model: ModelledEngagement | null;
}

export interface EngagementOut {
  measured: MeasuredEngagement[];
  compared: ComparedEngagement | null;
}

// --- service/schemas/run.py

export interface Warned {
  code: string;
  message: string;
}

export interface Parameters {
  static_torque_nm: number;
  coulomb_ratio: number;
  stribeck_velocity_m_s: number;
  viscous_coefficient: number;
}

export interface Fit {
  pressure_bar: number;
  parameters: Parameters;
  standard_errors: Parameters;
  mse_percent: number | null;
  rmse_nm: number;
  acceptable: boolean;
  mean_cof: number | null;
  mean_cof_sd: number | null;
  status: string;
  undetermined: string[];
}

export interface Loop {
  pressure_bar: number;
  loop_area_nm_m_s: number | null;
  loop_area_sd_nm_m_s: number | null;
  attractor_nm_s: number | null;
  attractor_sd_nm_s: number | null;
  film_time_s: number | null;
  film_time_sd_s: number | null;
  frequency_hz: number | null;
  direction: string;
  better_law: string | null;
  periods: number;
  status: string;
  message: string;
}

export interface Duty {
  cycles: number;
  energy_per_cycle_kj: number | null;
}

export interface Receipt {
  clutch_id: string;
  run_id: string;
  kind: string;
  cycles: number;
  started_at: string | null;
  origin: string;
  received_at: string;
  content_sha256: string;
  file: { filename: string; sha256: string; bytes: number; rig: string | null } | null;
  duplicate: boolean;
  state: "accepted" | "held" | "withdrawn";
  doubts: (Warned & { likely_cycles?: number })[];
  sent_cycles: number;
  warnings: Warned[];
  fits: Fit[];
  loops: Loop[];
  engagement: ReceivedEngagement | null;
  duty: Duty | null;
  event: string | null;
  note: string | null;
  code_version: string;
}

/** An entry of the audit trail. */
export interface Change {
  at: string;
  by: string;
  action: string;
  run_id: string | null;
  reason: string;
  before: Record<string, unknown>;
  after: Record<string, unknown>;
}

export interface RunOut extends Receipt {
  samples: number;
  channels: Channels;
}

/** The channels that Stribeck tests always have. */
export interface StationaryChannels {
  pressure_bar: number[];
  speed_rpm: number[];
  torque_nm: number[];
}

export type Channels = StationaryChannels;

// --- service/schemas/inspection.py

export interface PhotographOut {
  photograph_id: string;
}

export interface InspectionOut {
  clutch_id: string;
  inspection_id: string;
  cycles: number;
  performed_at: string | null;
  lining: string;
  roughness_um: number | null;
  skewness: number | null;
  note: string;
  state: "accepted" | "withdrawn";
  photographs: PhotographOut[];
}

// --- service/schemas/diagnosis.py; null is what is not known, or not yet

export interface Amplitude {
  name: string;
  value: number | null;
  sd: number | null;
  unit: string;
}

export interface ExplanationOut {
  effects: string[];
  probability: number | null;
  sign_probability: number | null;
}

export interface CandidateOut {
  effect: string;
  title: string;
  probability: number | null;
  log_evidence_gain: number | null;
  estimate: Amplitude;
}

export interface WhereOut {
  axis: string;
  strength: number | null;
  p_value: number | null;
}

export interface MisfitOut {
  rmse_nm: number | null;
  noise_nm: number | null;
  unexplained_share: number | null;
  where: WhereOut[];
}

/** Answers as `/remaining-useful-life` gives them. */
export interface BeforeAndAfter {
  before: Partial<RemainingLife>;
  after: Partial<RemainingLife>;
}

export interface GainOut {
  held_out_runs: string[];
  rmse_before_nm: number | null;
  rmse_after_nm: number | null;
  reduction_percent: number | null;
  log_score_gain: number | null;
  prediction_log_score_gain: number | null;
  remaining_useful_life: BeforeAndAfter;
}

export interface AdviceOut {
  test: string;
  separates: string[];
}

export interface VisibleOut {
  effect: string;
  amplitude: number | null;
  least: number | null;
  unit: string;
}

export interface Axes {
  pressure_bar: number[];
  speed_rpm: number[];
  cycles: number[];
}

export type Table = (number | null)[][];

export interface ResidualMap {
  speed_pressure: Table;
  pressure_cycles: Table;
}

export interface MapsOut {
  axes: Axes;
  before: ResidualMap;
  after: ResidualMap;
}

export interface LoopTraceOut {
  pressure_bar: number;
  cycles: number;
  frequency_hz: number | null;
  speed_rpm: (number | null)[];
  measured_nm: (number | null)[];
  baseline_nm: (number | null)[];
  extended_nm: (number | null)[];
}

export interface DiagnosisListed {
  diagnosis_id: string;
  status: "running" | "finished" | "failed";
  created_at: string;
  as_of_cycles: number | null;
  stale: boolean;
  earlier_life: boolean;
  adoptable: boolean;
  adopted: boolean;
  problem: string | null;
  verdict: string | null;
  causes: string[];
  summary: string;
  explanations: ExplanationOut[];
  candidates: CandidateOut[];
  baseline: MisfitOut;
  extended: MisfitOut;
  gain: GainOut;
  advice: AdviceOut[];
  visible: VisibleOut[];
  notes: string[];
}

export interface DiagnosisOut extends DiagnosisListed {
  maps: MapsOut | null;
  loops: LoopTraceOut[];
}

/** A column of a rig's files. */
export interface RigColumn {
  title: string;
  channel: string | null;
  unit?: string | null;
  stated?: string | null;
  scale?: number;
  offset?: number;
}

/** How the files of a rig are read. */
export interface RigProfile {
  columns: RigColumn[];
  decimal: string | null;
  table: string | null;
  kind: string | null;
  file_name: string | null;
}

export interface PreviewColumn {
  title: string;
  stated_unit: string | null;
  unit: string | null;
  channel: string | null;
  scale: number;
  offset: number;
}

/** A file as it would be read. */
export interface Preview {
  columns: PreviewColumn[];
  tables: string[];
  first_rows: string[][];
  units: Record<string, string[]>;
  rig: string | null;
  profile: RigProfile;
  kind: string | null;
  cycles: number | null;
  missing: string[];
  channels: Record<string, number[]>;
  pieces: { start_s: number; stop_s: number; pressure_bar: number; speed_rpm: number | null }[];
  fits: Fit[];
  warnings: Warned[];
  problem: string | null;
}
