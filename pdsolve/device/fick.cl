/* Forward Euler of Fick's law on one lattice: pdsolve/lattice/families and pdsolve/steppers/euler in OpenCL C.

A work item is a node, n of them; sites, slots and their order are those of the processor, as is what is rounded once
(fma). Symbols as in pdsolve/lattice/fluxes. Bonds in turn are added to two sums, as in pdsolve/laws/fluxes.

    amount    (m,) potential times volume, 0 at sites without a node
    loads     entries (loads,) of nodes, from load_first (n + 1,) on; holds likewise
    factors   2 p of a step: of loads, at its beginning; of holds, at its end
*/

__kernel void put(__global const int *site, __global const double *volume, __global const double *h,
                  __global double *potential, __global double *amount, int n) {
  int i = get_global_id(0);
  if (i >= n)
    return;
  potential[i] = POTENTIAL(h[i]);
  amount[site[i]] = potential[i] * volume[i];
}

__kernel void advance(__global const int *site, __global const double *volume, __global const double *potential,
                      __global const double *amount, __global const int *ahead, __global const double *g,
                      __global const ushort *bits, __global const uchar *general, __global const double *D,
                      __global const double *total, __global const double *outside, __global const long *start,
                      __global const int *neighbour, __global const double *more, __global const double *more_total,
                      __global double *h, __global double *rate, __global double *dissipated, __global double *work,
                      __global double *source, __global const int *load_first, __global const double *load_value,
                      __global const int *load_profile, __global const int *hold_first,
                      __global const double *hold_value, __global const int *hold_profile,
                      __global const double *factors, int profiles, int at, double dt, int n) {
  int i = get_global_id(0);
  if (i >= n)
    return;
  __global const double *of_loads = factors + 2L * profiles * at, *of_holds = of_loads + profiles;
  __global const double *a = amount + site[i];
  int tile = (site[i] - MARGIN) / 16, lane = (site[i] - MARGIN) % 16;
  double s[2] = {0, 0};
  for (int k = 0; k < SLOTS; ++k) {
    double w = g[k];
    if (general[tile])
      w = bits[(long)tile * SLOTS + k] >> lane & 1 ? w * SHARE_OF(D[site[i]], D[site[i] + ahead[k]]) : 0;
    s[k % 2] = fma(w, a[ahead[k]], s[k % 2]);
  }
  double out = D[site[i]] * (s[0] + s[1]) - total[i] * potential[i];
  double added[2] = {0, 0}; /* by the few bonds of a surface correction */
  for (long k = start[i]; k < start[i + 1]; ++k) {
    int number = (k - start[i]) % 2, j = neighbour[k];
    added[number] = fma(more[k], volume[j] * potential[j], added[number]);
  }
  out += added[0] + added[1];
  out -= more_total[i] * potential[i];
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
