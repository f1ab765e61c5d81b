/* Forward Euler of Fick's law on one lattice: pdsolve/diffusion/lattice and pdsolve/steppers/euler in OpenCL C.

A work item is a node, n of them; cells, slots and their order are those of the processor, as is what is rounded once
(fma). Symbols as in pdsolve/diffusion/lattice.

    amount    (cells,) potential times volume, 0 in cells without a node
    loads     entries (loads,) of nodes, from load_first (n + 1,) on; holds likewise
    factors   2 p of a step: of loads, at its beginning; of holds, at its end
*/

__kernel void put(__global const int *cell, __global const double *volume, __global const double *h,
                  __global double *potential, __global double *amount, int n) {
  int i = get_global_id(0);
  if (i >= n)
    return;
  potential[i] = POTENTIAL(h[i]);
  amount[cell[i]] = potential[i] * volume[i];
}

/* What few bonds add, each with the conductance c */
inline double changed(__global const long *start, __global const uint *neighbour, __global const double *c,
                      __global const double *volume, __global const double *potential, int i) {
  double t = 0;
  for (long k = start[i]; k < start[i + 1]; ++k) {
    uint j = neighbour[k];
    t = FLUX(c[k], volume[j], potential[i], potential[j], t);
  }
  return t;
}

__kernel void advance(__global const int *cell, __global const double *volume, __global const double *potential,
                      __global const double *amount, __global const int *ahead, __global const double *g,
                      __global const double *scale, __global const double *outflow, __global const double *outside,
                      __global const long *start_of_unlike, __global const uint *unlike,
                      __global const double *of_unlike, __global const long *start_of_more, __global const uint *more,
                      __global const double *of_more, __global double *h, __global double *rate,
                      __global double *dissipated, __global double *work, __global double *source,
                      __global const int *load_first, __global const double *load_value,
                      __global const int *load_profile, __global const int *hold_first,
                      __global const double *hold_value, __global const int *hold_profile,
                      __global const double *factors, int profiles, int at, double dt, int n) {
  int i = get_global_id(0);
  if (i >= n)
    return;
  __global const double *of_loads = factors + 2L * profiles * at, *of_holds = of_loads + profiles;
  __global const double *a = amount + cell[i];
  double s = 0;
  int k = 0;
#define OF(q) g[k + q], a[ahead[k + q]]
  for (; k < EIGHTS; k += 8)
    s += FOUR(OF(0), OF(1), OF(2), OF(3)) + FOUR(OF(4), OF(5), OF(6), OF(7));
  for (; k < SLOTS; k += 2)
    s += TWO(OF(0), OF(1));
  double out = GAINED(scale[i], s, outflow[i], potential[i]);
#ifdef UNLIKE
  out += changed(start_of_unlike, unlike, of_unlike, volume, potential, i);
#endif
#ifdef MORE
  out += changed(start_of_more, more, of_more, volume, potential, i);
#endif
#ifdef OPEN
  double given = -outside[i] * potential[i], booked = dt * given;
  work[i] += booked;
  out += given;
#endif
  if (hold_first[i] < hold_first[i + 1]) {
    double kept = dt * out;
    dissipated[i] += kept;
  }
#ifdef LOADS
#ifdef VARIES
  double sum = 0;
  for (int e = load_first[i]; e < load_first[i + 1]; ++e) {
    double share = load_value[e] * of_loads[load_profile[e]];
    sum += share;
  }
  source[i] = sum;
#endif
  double supplied = dt * source[i];
  work[i] += supplied;
  out += source[i];
#endif
  rate[i] = out;
  double change = out * dt;
  h[i] += change;
  for (int e = hold_first[i]; e < hold_first[i + 1]; ++e)
    h[i] = hold_value[e] * of_holds[hold_profile[e]];
}
