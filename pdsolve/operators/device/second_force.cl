/* Force over stiffness that a bond adds one step after the step in which it broke: `second_force` of
pdsolve/laws/calls.py in OpenCL C. */
#ifdef MATCHING_FORCE
inline double second_share(double growth, double next_growth) {
  if (next_growth <= GROWTH || growth <= GROWTH)
    return 0.0;
  double r = growth / next_growth - 1.0;
  return r < 1.0 ? r / (1.0 + sqrt(1.0 - r * r)) : 1.0;
}

inline double SECOND_FORCE(double stretch, double before, double first, double worst, double peak, double limit) {
  double over_limit = fmax(before, limit * (1.0 + GROWTH));
  return MATCHING_FORCE(over_limit, first, worst, peak, limit) * second_share(before - first, stretch - before);
}
#endif
