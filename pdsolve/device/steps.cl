/* One step of all nodes, TOGETHER of them a work item: velocity Verlet ends `step` and begins the next one.

The scheme is that of pdsolve/steppers/euler.py where FIRST_ORDER is defined, of pdsolve/lattice/march.py where FUSED is,
whose numbers are of the run's precision and which divides by rho where DIVIDES is, else of pdsolve/steppers/verlet.py,
which computes in double precision; with damping where DAMPED is. Nodes on which more than bonds acts have a row of
`acts`, else -1:

    now, ago_force   (rows, DIM) load now and one step ago, N/m^3       load_first, hold_first   (rows + 1,) entries
    load_, hold_     columns of `Entries`                                held_speed, held_force   (holds,) of `Drive`
    factors          3 p of a step: at its end, at the end of the next one, and half a step before that; of Euler at
                     its beginning, where loads act, and twice at its end
*/

#define STARTS 1
#define ENDS 2
#define DISPLACEMENT 0
#define VELOCITY 1
#define ACCELERATION 2

#define MOMENT __global const double *factors, int profiles, int varies, double dt, int m, int step, int phase, int at

#ifdef FUSED
#define KICKED(v, a) ((v) + half_dt * (a))
#define MOVED_BY(u, v) ((u) + (REAL)dt * (v))
#else
#define KICKED(v, a) ((REAL)((double)(v) + dt / 2.0 * (double)(a)))
#define MOVED_BY(u, v) ((REAL)((double)(u) + dt * (double)(v)))
#endif

/* Node i, with what bonds do to it, but where a march starts: the force density f, N/m^3, or the rate of a content */
inline void take(FORCE_PARAMETERS, MOTION_PARAMETERS, MOMENT, int i, SUM *f) {
  int k = acts[i];
  __global const double *end = factors + 3 * profiles * at, *next = end + profiles, *middle = next + profiles;
  int loads = k >= 0 ? load_first[k] : 0, end_loads = k >= 0 ? load_first[k + 1] : 0;
  int holds = k >= 0 ? hold_first[k] : 0, end_holds = k >= 0 ? hold_first[k + 1] : 0;
  if (!(phase & STARTS) && varies && loads < end_loads) {
    for (int axis = 0; axis < DIM; ++axis) {
      ago_force[DIM * k + axis] = now[DIM * k + axis];
      now[DIM * k + axis] = 0;
    }
    for (int e = loads; e < end_loads; ++e) {
      double share = load_value[e] * end[load_profile[e]];
      now[DIM * k + load_axis[e]] = (REAL)((double)now[DIM * k + load_axis[e]] + share);
    }
  }
#ifdef FIRST_ORDER
  double content = a[i];
  if (!(phase & STARTS)) {
    double potential = POTENTIAL(content), out = rate_of(FORCE_ARGUMENTS, u, i, potential, f[0]);
    if (outside[i] != 0) {
      double inflow = -outside[i] * potential, supplied = dt * inflow;
      work[i] += supplied;
      out += inflow;
    }
    if (holds < end_holds) {
      double brought = dt * out;
      dissipated[i] += brought;
    }
    if (loads < end_loads) {
      double supplied = dt * now[k];
      work[i] += supplied;
      out += now[k];
    }
    double change = out * dt;
    content += change;
    for (int e = holds; e < end_holds; ++e)
      content = hold_value[e] * next[hold_profile[e]];
    a[i] = content;
    rate_after[i] = out;
  }
  after[i] = POTENTIAL(content) * weight[m + i];
#else
  REAL v[DIM], acc[DIM];
  REAL half_dt = (REAL)(dt / 2.0);
  for (int axis = 0; axis < DIM; ++axis) {
    v[axis] = rate[axis * m + i];
    acc[axis] = a[axis * m + i];
  }
  if (!(phase & STARTS)) {
    REAL was[DIM];
    for (int axis = 0; axis < DIM; ++axis)
      was[axis] = v[axis] - half_dt * acc[axis];
    for (int axis = 0; axis < DIM; ++axis) {
      REAL load = k >= 0 ? now[DIM * k + axis] : (REAL)0;
#ifdef FUSED
      f[axis] += load;
#ifdef DIVIDES
      acc[axis] = f[axis] / weight[m + i];
#else
      acc[axis] = f[axis] * weight[i];
#endif
#else
      acc[axis] = (REAL)((f[axis] + (double)load) / (double)weight[m + i]);
#endif
    }
    for (int axis = 0; loads < end_loads && axis < DIM; ++axis) {
      REAL both = ago_force[DIM * k + axis] + now[DIM * k + axis];
      work[i] += (double)both / 2.0 * (dt * (double)v[axis]);
    }
    for (int e = holds; e < end_holds; ++e) {
      int axis = hold_axis[e];
      double rho = (double)weight[m + i], force = (double)(REAL)(weight[m + i] * acc[axis]), way = dt * (double)v[axis];
      double value = hold_value[e] * end[hold_profile[e]];
      acc[axis] = hold_kind[e] == ACCELERATION ? (REAL)value : (REAL)0;
      if (hold_kind[e] == VELOCITY)
        v[axis] = (REAL)value;
      double speed = (double)v[axis] + dt / 2.0 * (double)acc[axis];
      work[i] += rho / 2.0 * (speed * speed - held_speed[e] * held_speed[e]);
      work[i] -= (held_force[e] + force) / 2.0 * way;
      held_force[e] = force;
    }
    for (int axis = 0; axis < DIM; ++axis)
      v[axis] = KICKED(v[axis], acc[axis]);
#ifdef DAMPED
    for (int axis = 0; axis < DIM; ++axis) {
      bool held = false;
      for (int e = holds; e < end_holds; ++e)
        held = held || hold_axis[e] == axis;
      if (!held) {
        SUM c = (SUM)damping[i], undamped = (SUM)acc[axis], mean = (SUM)v[axis] - (SUM)(dt / 2.0) * undamped;
        v[axis] = (REAL)((SUM)v[axis] / ((SUM)1 + c * (SUM)dt / (SUM)2));
        acc[axis] = (REAL)(undamped - c * (SUM)v[axis]);
        REAL both = was[axis] + v[axis];
        damped[i] += (double)((SUM)weight[m + i] * c * (SUM)both / (SUM)2 * ((SUM)dt * mean));
      }
    }
#endif
#if defined(FUSED) && !defined(DAMPED)
    if (phase & ENDS)
#endif
      for (int axis = 0; axis < DIM; ++axis)
        a[axis * m + i] = acc[axis];
  }
  if (!(phase & ENDS)) {
    REAL place[DIM];
    for (int axis = 0; axis < DIM; ++axis) {
      v[axis] = KICKED(v[axis], acc[axis]);
      place[axis] = MOVED_BY(u[axis * m + i], v[axis]);
    }
    for (int e = holds; e < end_holds; ++e) {
      int axis = hold_axis[e];
      held_speed[e] = (double)v[axis] - dt / 2.0 * (double)acc[axis];
      double start = (double)place[axis] - dt * (double)v[axis];
      if (hold_kind[e] == DISPLACEMENT) {
        place[axis] = (REAL)(hold_value[e] * next[hold_profile[e]]);
        v[axis] = (REAL)(((double)place[axis] - start) / dt);
      } else if (hold_kind[e] == VELOCITY) {
        v[axis] = (REAL)(hold_value[e] * middle[hold_profile[e]]);
        place[axis] = (REAL)(start + dt * (double)v[axis]);
      }
    }
    for (int axis = 0; axis < DIM; ++axis)
      after[axis * m + i] = place[axis];
  }
  for (int axis = 0; axis < DIM; ++axis)
    rate_after[axis * m + i] = v[axis];
#endif
}

__kernel __attribute__((reqd_work_group_size(64 / TOGETHER, 1, 1)))
void advance(FORCE_PARAMETERS, MOTION_PARAMETERS, MOMENT) {
  int first = TOGETHER * get_global_id(0);
  SUM sums[DIM * TOGETHER], f[DIM];
  if (!(phase & STARTS))
    sum_bonds(FORCE_ARGUMENTS, before, u, rate, dt, m, step, first, sums);
  for (int i = first; i < first + TOGETHER; ++i) {
    if (ABSENT(i))
      continue;
    for (int axis = 0; axis < DIM; ++axis)
      f[axis] = sums[TOGETHER * axis + i - first];
    take(FORCE_ARGUMENTS, MOTION_ARGUMENTS, factors, profiles, varies, dt, m, step, phase, at, i, f);
  }
}
