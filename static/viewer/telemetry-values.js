// Values of columns, and how telemetry writes and scales them.

export const number = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits));

export function clock(ms) {
  if (ms === null || ms === undefined) return "–";
  const whole = Math.floor(ms);
  return `${Math.floor(whole / 60000)}:${String(Math.floor(whole / 1000) % 60).padStart(2, "0")}.${String(whole % 1000).padStart(3, "0")}`;
}

// Zero and the roundest value that both sides have room for, twice if there is room.
export function evenly(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  const step = [5, 2, 1].map((digit) => digit * power).find((each) => each <= most);
  return [-2, -1, 0, 1, 2].map((times) => times * step).filter((value) => Math.abs(value) <= most);
}

// The index with the largest value <= `value` in rising values that may end with nulls.
function lastAt(values, value) {
  let low = 0;
  let high = values.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] !== null && values[middle] <= value) low = middle; else high = middle;
  }
  return low;
}

// The value of one column where another has `value`; null where it has none.
export function valueAt(keys, values, value) {
  const i = lastAt(keys, value);
  const [a, b] = [values[i], values[i + 1]];
  if (a === null || a === undefined) return null;
  if (b === null || b === undefined || keys[i + 1] === null || keys[i + 1] === keys[i]) return keys[i] >= value - 1e-9 ? a : null;
  return a + (b - a) * Math.max(0, (value - keys[i]) / (keys[i + 1] - keys[i]));
}

// Both signs of the delta always have room, so that zero is seen.
export function span(name, low, high) {
  if (low === null || high === null || low === undefined || Number.isNaN(low)) return [0, 1];
  if (name === "speed") return [0, Math.max(high, 0.5) * 1.05];
  const most = Math.max(Math.abs(low), Math.abs(high), name === "delta" ? 0.05 : 0.1) * 1.08;
  return name === "reward" ? [Math.min(0, low), Math.max(high, 0.1) * 1.05] : name === "delta" ? [Math.min(low * 1.1, -0.05), Math.max(high * 1.1, 0.05)] : [-most, most];
}
