/** Residuals drawn: by direction, and by place in the picture. The colour is the direction in both. */

/** Sides of the drawing that are left for the rings' labels (px). */
const MARGIN = 8;
/** Rings around the middle, of which the first is about as large as residuals are. */
const RINGS = [1, 2, 3, 4];
/** An arrow of typical length is drawn as long as this share of the picture's width. */
const TYPICAL = 0.025;
/** Points of which the arrows are drawn thinner. */
const MANY = 400;

/** Return the points of `views` (as `GET /calibrations/{id}/residuals` has them) in one list. */
export function pointsOf(views) {
  return views.flatMap((view) => view.pixels.map(([x, y], i) => ({ x, y, dx: view.residuals[i][0], dy: view.residuals[i][1] })));
}

/** Return what a set of points is like: rms, and the mean of each direction (px). */
export function summaryOf(points) {
  const count = Math.max(points.length, 1);
  const sum = (of) => points.reduce((total, point) => total + of(point), 0);
  return {
    count: points.length,
    rms: Math.sqrt(sum(({ dx, dy }) => dx * dx + dy * dy) / count),
    meanX: sum(({ dx }) => dx) / count,
    meanY: sum(({ dy }) => dy) / count,
  };
}

/** Return the number of the form 1, 2 or 5 times a power of ten that is next to `value` from above. */
export function round125(value) {
  if (!(value > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value * 0.999);
}

/** Return how many times longer than they are arrows are drawn, so that typical ones are seen in a picture `width` px wide. */
export function magnification(points, width) {
  const { rms } = summaryOf(points);
  return rms > 0 ? round125((TYPICAL * width) / rms) : 1;
}

/** Draw residuals by direction: a point for each, the middle being none, with rings to measure by. */
export function drawByDirection(canvas, points) {
  const { context, width, height, colours } = begin(canvas, 1);
  const { rms } = summaryOf(points);
  const ring = round125(0.7 * rms);
  const reach = RINGS.length * ring;
  const scale = (Math.min(width, height) / 2 - MARGIN) / reach;
  context.translate(width / 2, height / 2);
  context.strokeStyle = colours.line;
  context.fillStyle = colours.muted;
  context.font = colours.font;
  line(context, -reach * scale, 0, reach * scale, 0);
  line(context, 0, -reach * scale, 0, reach * scale);
  for (const times of RINGS) {
    context.beginPath();
    context.arc(0, 0, times * ring * scale, 0, 2 * Math.PI);
    context.stroke();
  }
  for (const { dx, dy } of points) {
    const far = Math.hypot(dx, dy) / reach;
    const shrink = far > 1 ? 1 / far : 1; // what is farther out is drawn at the edge
    context.fillStyle = colours.of(dx, dy);
    context.beginPath();
    context.arc(dx * scale * shrink, dy * scale * shrink, far > 1 ? 3.5 : 2, 0, 2 * Math.PI);
    context.fill();
  }
  context.fillStyle = colours.text;
  for (const times of RINGS) {
    const text = `${Number((times * ring).toPrecision(3))} px`;
    const at = -times * ring * scale + 12;
    context.fillStyle = colours.surface;
    context.fillRect(3, at - 10, context.measureText(text).width + 4, 13);
    context.fillStyle = colours.text;
    context.fillText(text, 5, at);
  }
}

/** Draw residuals by place: an arrow from where each point is seen, `times` as long as it is. */
export function drawByPlace(canvas, points, size, times) {
  const { context, width, height, colours } = begin(canvas, size.height / size.width);
  const scale = width / size.width;
  context.strokeStyle = colours.line;
  context.strokeRect(0.5, 0.5, width - 1, height - 1);
  arrows(context, points, scale, times, colours, points.length > MANY ? 1 : 1.5);
}

/** Draw a view's picture, and over it the arrows of its points. */
export function drawOnPicture(canvas, image, points, size, times) {
  const { context, width, height, colours } = begin(canvas, size.height / size.width);
  context.drawImage(image, 0, 0, width, height);
  arrows(context, points, width / size.width, times, { ...colours, of: () => "#ffffff" }, 5);
  arrows(context, points, width / size.width, times, { ...colours, of: colours.onPicture }, 2);
}

function arrows(context, points, scale, times, colours, thickness) {
  context.lineCap = "round";
  for (const { x, y, dx, dy } of points) {
    const [fromX, fromY] = [(x + 0.5) * scale, (y + 0.5) * scale];
    const [alongX, alongY] = [dx * times * scale, dy * times * scale];
    const length = Math.hypot(alongX, alongY);
    context.strokeStyle = context.fillStyle = colours.of(dx, dy);
    context.lineWidth = thickness;
    line(context, fromX, fromY, fromX + alongX, fromY + alongY);
    if (length < 4) continue;
    const head = Math.min(5, length / 2) / length;
    const [toX, toY] = [fromX + alongX, fromY + alongY];
    line(context, toX, toY, toX - head * (alongX - 0.6 * alongY), toY - head * (alongY + 0.6 * alongX));
    line(context, toX, toY, toX - head * (alongX + 0.6 * alongY), toY - head * (alongY - 0.6 * alongX));
  }
}

/** Make the canvas as sharp as the screen, `ratio` times as high as it is wide, and empty. */
function begin(canvas, ratio) {
  const width = canvas.clientWidth || 300;
  const height = Math.round(width * ratio);
  const sharp = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * sharp);
  canvas.height = Math.round(height * sharp);
  const context = canvas.getContext("2d");
  context.setTransform(sharp, 0, 0, sharp, 0, 0);
  return { context, width, height, colours: coloursOf(canvas) };
}

function coloursOf(element) {
  const style = getComputedStyle(element);
  const named = (name) => style.getPropertyValue(name).trim();
  const isDark = window.matchMedia("(prefers-color-scheme: dark)").matches;
  const hue = (dx, dy) => Math.round((Math.atan2(dy, dx) * 180) / Math.PI);
  return {
    line: named("--line"),
    text: named("--text"),
    muted: named("--muted"),
    surface: named("--surface"),
    font: `12px ${style.fontFamily}`,
    of: (dx, dy) => `hsl(${hue(dx, dy)} 75% ${isDark ? 65 : 38}%)`,
    onPicture: (dx, dy) => `hsl(${hue(dx, dy)} 90% 38%)`,
  };
}

function line(context, x, y, toX, toY) {
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(toX, toY);
  context.stroke();
}
