/* Bonds of lattices in the plane, under a pair law with straight lines, softened ones with all their stiffness where
shortened if ONE_SIDED: pdsolve/operators/simd_lattice in OpenCL C.

A work item is a node, a work group a block of 64. A node gathers its family slot by slot, in the order of the processor,
and alone changes what its bonds remember: no atomics. Products and sums are rounded once where the processor's vectors
are (fma), and nowhere else. Symbols as in `Blocks`; m nodes in whole blocks.

    gone     (w, m) bits of the slots of a node's block: its bond there is broken; 32 a word
    soft     (w, m) likewise: it has softened, and has its own `pull`, `own_edge` and `worst` (slots, 64)
    own_edge of a bond that broke in the last step: its stretch one step before that; `last_break` (m,) the last step in
             which a bond of the node broke
    broken   (slots, 64) step in which the bond broke, 0 while intact
    torn     (blocks,) whether a bond of the block has broken or softened since the host looked
*/

#define FORCE_PARAMETERS                                                                                               \
  __global const int *start, __global const int *slots, __global const int *ids, __global const REAL *vectors,        \
      __global const REAL *stiffness, __global const REAL *edge, __global const REAL *peak,                            \
      __global const REAL *limit, __global uint *gone, __global int *broken, __global int *torn,                      \
      __global double *dissipated, __global uint *soft, __global REAL *pull, __global REAL *own_edge,                 \
      __global REAL *worst, __global int *last_break
#define SUM REAL
#define ABSENT(i) false
#define FORCE_ARGUMENTS                                                                                                \
  start, slots, ids, vectors, stiffness, edge, peak, limit, gone, broken, torn, dissipated, soft, pull, own_edge, worst,  \
      last_break

/* 1 / (1 + e + sqrt(1 + e)) */
inline REAL over_root(REAL e, REAL size) {
  if (size <= (REAL)NARROW)
    return POLYNOMIAL_NARROW(REAL, e);
  if (size <= (REAL)WIDE)
    return POLYNOMIAL_WIDE(REAL, e);
  REAL q2 = (REAL)1 + e;
  return (REAL)1 / (q2 + sqrt(q2));
}

inline double stretched(__global const REAL *v, REAL x, REAL y) {
  REAL inverse = v[4];
  double along = 2.0 * (double)(v[0] * x + v[1] * y);
  double e = (double)inverse * (along + (double)(REAL)(x * x) + (double)(REAL)(y * y));
  return e / (sqrt(1.0 + e) + 1.0);
}

/* Displacement of a node one step ago */
inline REAL ago(__global const REAL *before, __global const REAL *u, __global const REAL *rate, REAL dt, int at) {
#ifdef FUSED
  return before[at];
#else
  REAL way = dt * rate[at];
  return u[at] - way;
#endif
}

/* Force density on node i, N/m^3; bonds over their limit break in this step, those over their peak soften. */
inline void sum_bonds(FORCE_PARAMETERS, __global const REAL *before, __global const REAL *u, __global const REAL *rate,
                      double step_time, int m, int step, int i, SUM *force) {
  REAL dt = (REAL)step_time;
  int b = i / 64, lane = i % 64;
  REAL here_x = u[i], here_y = u[m + i], fx = 0, fy = 0;
  int first = start[b], last = start[b + 1];
#ifdef MATCHING_FORCE
  bool is_pending = last_break[i] == step - 1;
#endif
  for (int slot = first; slot < last; ++slot) {
    __global const int *row = slots + 8L * slot;
    long place = (long)((slot - first) / 32) * m + i, own = 64L * slot + lane;
    uint bit = 1u << ((slot - first) % 32);
    REAL w = stiffness[64 * row[5] + lane], most = edge[64 * row[6] + lane];
#ifdef MATCHING_FORCE
    bool is_gone = gone[place] & bit, pulls_again = is_gone && is_pending && broken[own] == step - 1;
#else
    bool is_gone = gone[place] & bit, pulls_again = false;
#endif
    if ((w == 0 && isinf(most)) || (is_gone && !pulls_again)) /* no bond; one of no stiffness breaks like any other */
      continue;
    int way = row[lane / 16];
    int j = way < FAR ? i + way : ids[16L * (way - FAR) + lane % 16];
    __global const REAL *v = vectors + 8 * row[4];
    REAL x = u[j] - here_x, y = u[m + j] - here_y;
    REAL along = fma(v[4], x, v[2]) * x;
    REAL e = fma(fma(v[4], y, v[3]), y, along), size = fabs(e);
#ifdef SOFTENS
    if (!is_gone && soft[place] & bit) {
      w = pull[own];
      most = own_edge[own];
    }
#endif
    if (e > most || pulls_again) {
      double stretch = (double)e / (1.0 + sqrt(1.0 + (double)e));
      REAL highest = peak[64 * row[7] + lane], end = limit[64 * row[7] + lane], whole = stiffness[64 * row[5] + lane];
      REAL last_x = ago(before, u, rate, dt, j) - ago(before, u, rate, dt, i);
      REAL last_y = ago(before, u, rate, dt, m + j) - ago(before, u, rate, dt, m + i);
      double last = stretched(v, last_x, last_y);
#ifdef SOFTENS
      double largest = worst[own];
#else
      double largest = 0;
#endif
#ifdef MATCHING_FORCE
      if (pulls_again) {
        double pull_then = SECOND_FORCE(stretch, last, (double)own_edge[own], largest, (double)highest, (double)end);
        double more = pull_then / (1.0 + stretch) * (double)whole;
        fx = (REAL)((double)fx + more * (double)(REAL)(v[0] + x));
        fy = (REAL)((double)fy + more * (double)(REAL)(v[1] + y));
        own_edge[own] = end;
        torn[b] = 1;
        continue;
      }
      if (stretch > (double)highest) {
        double more = MATCHING_FORCE(stretch, last, largest, highest, end) / (1.0 + stretch) * (double)whole;
        fx = (REAL)((double)fx + more * (double)(REAL)(v[0] + x));
        fy = (REAL)((double)fy + more * (double)(REAL)(v[1] + y));
      }
#endif
      if (stretch > (double)end) {
        double c = (double)(REAL)(whole / v[4]) / 4.0;
#ifdef MATCHING_FORCE
        if (last < (double)end)
          dissipated[i] += TOTAL_DISSIPATED(c, highest, end);
        else
#endif
          dissipated[i] += DISSIPATED_AT_BREAK(c, stretch, last, highest, end);
        broken[own] = last_break[i] = step;
#ifdef MATCHING_FORCE
        own_edge[own] = last < (double)end && last < stretch ? (REAL)last : end;
#endif
        gone[place] |= bit;
        torn[b] = 1;
        continue;
      }
#ifdef SOFTENS
      if (stretch > (double)highest) {
        worst[own] = (REAL)stretch;
        own_edge[own] = e;
        soft[place] |= bit;
        torn[b] = 1;
        w = pull[own] = (REAL)(SECANT(stretch, (double)worst[own], (double)highest, (double)end) * (double)whole);
      }
#endif
    }
#ifdef ONE_SIDED
    if (e <= 0)
      w = stiffness[64 * row[5] + lane];
#endif
    REAL along_bond = w * e;
    along_bond *= over_root(e, size);
    fx = fma(along_bond, v[0] + x, fx);
    fy = fma(along_bond, v[1] + y, fy);
  }
  force[0] = fx;
  force[1] = fy;
}

#ifdef TOGETHER
/* Force densities (DIM, TOGETHER) on the nodes from i on, in vectors; false where a bond of theirs is long, has softened,
   has broken one step ago or is over its limit, and nodes are summed one by one. */
inline bool sum_short(FORCE_PARAMETERS, __global const REAL *u, int m, int step, int i, SUM *force) {
  int b = i / 64, lane = i % 64, first = start[b], last = start[b + 1];
  for (int k = i; k < i + TOGETHER; ++k)
    if (last_break[k] == step - 1)
      return false;
  REALS here_x = LOAD(u + i), here_y = LOAD(u + m + i), fx = 0, fy = 0;
  INTEGERS others = 0;
  BITS lost = 0;
  uint some = 0;
  for (int slot = first; slot < last; ++slot) {
    int at = (slot - first) % 32;
    if (at == 0) {
      long place = (long)((slot - first) / 32) * m + i;
#ifdef SOFTENS
      BITS softened = LOAD(soft + place);
      if (ANY_OF(softened))
        return false;
#endif
      lost = LOAD(gone + place);
      some = ANY_OF(lost);
    }
    __global const int *row = slots + 8L * slot;
    __global const REAL *v = vectors + 8 * row[4];
    int way = row[lane / 16];
    REALS w = LOAD(stiffness + 64 * row[5] + lane), most = LOAD(edge + 64 * row[6] + lane), x, y;
    if (some >> at & 1) {
      INTEGERS out = WIDENED(TO_INTEGER)((lost >> (uint)at & 1u) != 0u);
      w = select(w, (REALS)0, out);
      most = select(most, (REALS)INFINITY, out);
    }
    if (way < FAR) {
      x = LOAD(u + i + way);
      y = LOAD(u + m + i + way);
    } else {
      __global const int *j = ids + 16L * (way - FAR) + lane % 16;
      x = GATHER(u, j);
      y = GATHER(u + m, j);
    }
    x -= here_x;
    y -= here_y;
    REALS along = fma((REALS)v[4], x, (REALS)v[2]) * x;
    REALS e = fma(fma((REALS)v[4], y, (REALS)v[3]), y, along);
    e = select(e, (REALS)0, w == 0 && isinf(most));
    others |= e > most || fabs(e) > (REALS)NARROW;
    REALS pull = w * e;
    pull *= POLYNOMIAL_NARROW(REALS, e);
    fx = fma(pull, (REALS)v[0] + x, fx);
    fy = fma(pull, (REALS)v[1] + y, fy);
  }
  WIDENED(vstore)(fx, 0, force);
  WIDENED(vstore)(fy, 0, force + TOGETHER);
  return !any(others);
}
#endif
