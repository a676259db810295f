// Numbers of a curve: points [x, y] at even distances, x in seconds. null where they mean nothing.
const measure = {
  HYSTERESIS: 0.1, // of the curve's span: less is no crossing
  UNEVEN: 1.5, // no frequency where one period is so much longer than another
  LIKE: 0.9, // nor where the curve correlates less with itself a period later: noise crosses its middle, too
  OVERLAP: 0.5, // of a period, that the curve must have beyond it
  FINER: 4, // the spectrum's points are so much closer than its lines: a peak between two lines keeps its height

  mean: (points) => points.length ? points.reduce((sum, point) => sum + point[1], 0) / points.length : null,

  rms: (points) => points.length ? Math.sqrt(points.reduce((sum, point) => sum + point[1] ** 2, 0) / points.length) : null,

  // From the first to the last time that it rises through the middle of its extremes.
  frequency(points) {
    const values = points.map((point) => point[1]), low = Math.min(...values), high = Math.max(...values), middle = (low + high) / 2, at = [];
    for (let n = 1, armed = false; n < points.length; n++) {
      const [x, y] = points[n], [before, under] = points[n - 1];
      armed ||= under <= middle - measure.HYSTERESIS * (high - low);
      if (armed && under < middle && y >= middle) { at.push(before + (x - before) * (middle - under) / (y - under)); armed = false; }
    }
    const periods = at.slice(1).map((x, n) => x - at[n]);
    if (!periods.length || Math.max(...periods) > measure.UNEVEN * Math.min(...periods)) { return null; }
    const period = (at.at(-1) - at[0]) / periods.length, step = (points.at(-1)[0] - points[0][0]) / (points.length - 1);
    return measure.likeness(values, Math.round(period / step)) >= measure.LIKE ? 1 / period : null;
  },

  // Of a curve and itself so many points later: the correlation; 0 where too little is left to tell.
  likeness(values, later) {
    const count = values.length - later;
    if (count < measure.OVERLAP * later) { return 0; }
    const [one, other] = [values.slice(0, count), values.slice(later)].map((part) => { const mean = part.reduce((sum, v) => sum + v, 0) / count; return part.map((v) => v - mean); });
    const product = (a, b) => a.reduce((sum, v, n) => sum + v * b[n], 0);
    return product(one, other) / (Math.sqrt(product(one, one) * product(other, other)) || 1);
  },

  // Amplitudes over hertz, with a Hann window: a sine has its peak value; the mean is taken off.
  spectrum(points) {
    const count = points.length, all = count * measure.FINER, mean = measure.mean(points);
    if (count < 4) { return []; }
    const turn = Array.from({ length: all }, (_, n) => 2 * Math.PI * n / all), cos = turn.map(Math.cos), sin = turn.map(Math.sin);
    const windowed = points.map((point, n) => (point[1] - mean) * (1 - cos[n * measure.FINER])); // twice the window, whose sum is half the count
    const step = (points.at(-1)[0] - points[0][0]) / (count - 1);
    return Array.from({ length: (all >> 1) + 1 }, (_, k) => {
      let re = 0, im = 0;
      for (let n = 0; n < count; n++) { re += windowed[n] * cos[k * n % all]; im += windowed[n] * sin[k * n % all]; }
      return [k / (all * step), 2 * Math.hypot(re, im) / count];
    });
  },

  // Where a spectrum is highest.
  peak: (points) => points.reduce((best, point) => point[1] > best[1] ? point : best, [null, 0])[0],
};
