// Colours that colour-blind readers can tell apart (Okabe and Ito); classes as in RFMGrasp's Fig. 3.

export const CLASS = ['#009e73', '#e6c200', '#d55e00'];
export const OUTCOME = ['#0072b2', '#e69f00', '#d55e00', '#cc79a7', '#999999', '#000000'];
// Lost, won, success in both runs, failure in both.
export const CHANGE = ['#d55e00', '#009e73', '#56b4e9', '#999999'];
export const UNKNOWN = '#888888';

// Dark violet to yellow, for probabilities.
const RAMP = ['#440154', '#3b528b', '#21918c', '#5ec962', '#fde725'];
export function ramp(p) {
  if (!(p >= 0)) return UNKNOWN;
  return RAMP[Math.min(RAMP.length - 1, Math.floor(p * RAMP.length))];
}
