/** Numbers as people read them: with their unit, a true minus, and no more digits than are meant. */

const LENGTHS = { m: 1000, cm: 10, mm: 1, um: 1e-3, in: 25.4 };
const ANGLES = { rad: 180 / Math.PI, mrad: 0.18 / Math.PI, deg: 1, turn: 360, rev: 360 };

/** Return `value` with `digits` after the point; with as many as it has where they are null. */
export function number(value, digits = 2) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = digits === null ? String(value) : value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** Return a value with its unit. */
export function quantity(value, unit, digits = 2) {
  const text = number(value, digits);
  return text === "–" ? text : text + sign(unit);
}

/** Return what follows a number of `unit`. */
export function sign(unit) {
  return unit === "deg" ? "°" : `\u00a0${unit}`;
}

/**
 * Return how readings of an axis (as the API describes it) are shown: in mm or degrees where their unit is a measure,
 * and as they are where it is not, such as counts. `factor` is how many of the shown `unit` one of the axis's is, `digits`
 * how many of them after the point mean something, by its tolerance.
 */
export function measureOf(axis) {
  const [factors, measure] = axis.kind === "revolute" ? [ANGLES, "deg"] : [LENGTHS, "mm"];
  const factor = factors[axis.unit] ?? 1;
  const unit = axis.unit in factors ? measure : axis.unit;
  const digits = Math.min(6, Math.max(0, Math.ceil(-Math.log10(axis.tolerance * factor))));
  return { factor, unit, digits };
}

/** Return a reading of an axis, in mm or degrees. */
export function reading(value, axis) {
  const { factor, unit, digits } = measureOf(axis);
  return quantity(value === null ? null : value * factor, unit, digits);
}

/** Return a duration in seconds in words, such as "4 min 10 s". */
export function duration(seconds) {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  const whole = Math.max(0, Math.round(seconds));
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor((whole % 3600) / 60);
  if (hours) return `${hours} h ${minutes} min`;
  return minutes ? `${minutes} min ${whole % 60} s` : `${whole} s`;
}

/** Return how large a file is. */
export function bytes(size) {
  const units = ["B", "kB", "MB", "GB"];
  const step = Math.min(units.length - 1, Math.floor(Math.log10(Math.max(size, 1)) / 3));
  return quantity(size / 1000 ** step, units[step], step ? 1 : 0);
}

/** Return the time of day of an RFC 3339 time, here. */
export function clock(time) {
  return new Date(time).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit" });
}

/** Return the date and time of day of an RFC 3339 time, here. */
export function moment(time) {
  const options = { year: "numeric", month: "short", day: "numeric", hour: "2-digit", minute: "2-digit", second: "2-digit" };
  return new Date(time).toLocaleString([], options);
}

/** Return a message of the daemon, which is in ASCII, begins small and has no full stop, as a sentence by itself. */
export function sentenceOf(message) {
  const begun = message[0].toUpperCase() + message.slice(1);
  return `${begun.replaceAll("+-", "± ")}${/[.?!]$/.test(message) ? "" : "."}`;
}
