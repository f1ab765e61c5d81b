/* Bonds of lattices, under a pair law with straight lines, softened ones with all their stiffness where
shortened if ONE_SIDED: pdsolve/operators/simd_lattice in OpenCL C.

A work item is a node, a work group a block of 64. A node gathers its family slot by slot, in the order of the processor,
and alone changes what its bonds remember: no atomics. Products and sums are rounded once where the processor's vectors
are (fma), and nowhere else. Symbols as in `Blocks`; m nodes in whole blocks.

    gone     (w, m) bits of the slots of a node's block: its bond there is broken; 32 a word
    soft     (w, m) likewise: it has softened, and has its own `pull`, `own_edge` and `worst` (slots, 64)
    own_edge of a bond that broke in the last step: its stretch one step before that; `last_break` (m,) the last step in
             which a bond of the node broke
    turn     a slot of the block; in space a place in `of_rows`, where the slots of rows of 16 nodes are
    broken   (slots, 64) step in which the bond broke, 0 while intact
    torn     (blocks,) whether a bond of the block has broken or softened since the host looked
*/

#define FORCE_PARAMETERS                                                                                               \
  __global const int *start, __global const int *slots, __global const int *start_of_rows,                            \
      __global const int *of_rows, __global const int *ids, __global const REAL *vectors,                              \
      __global const REAL *stiffness, __global const REAL *edge, __global const REAL *peak,                            \
      __global const REAL *limit, __global uint *gone, __global int *broken, __global int *torn,                      \
      __global double *dissipated, __global uint *soft, __global REAL *pull, __global REAL *own_edge,                 \
      __global REAL *worst, __global int *last_break
#define SUM REAL
#define ABSENT(i) false
#define FORCE_ARGUMENTS                                                                                                \
  start, slots, start_of_rows, of_rows, ids, vectors, stiffness, edge, peak, limit, gone, broken, torn, dissipated,      \
      soft, pull, own_edge, worst, last_break
#define INVERSE (2 * DIM)
#define WIDTH (DIM == 2 ? 8 : 9) /* of vectors */
#if DIM == 2
#define FIRST_TURN(i) start[(i) / 64]
#define END_TURN(i) start[(i) / 64 + 1]
#define SLOT(turn) (turn)
#else
#define FIRST_TURN(i) start_of_rows[(i) / 16]
#define END_TURN(i) start_of_rows[(i) / 16 + 1]
#define SLOT(turn) of_rows[turn]
#endif

/* 1 / (1 + e + sqrt(1 + e)) */
inline REAL over_root(REAL e, REAL size) {
  if (size <= (REAL)NARROW)
    return POLYNOMIAL_NARROW(REAL, e);
  if (size <= (REAL)WIDE)
    return POLYNOMIAL_WIDE(REAL, e);
  REAL q2 = (REAL)1 + e;
  return (REAL)1 / (q2 + sqrt(q2));
}

inline double stretched(__global const REAL *v, const REAL *eta) {
  REAL along = v[0] * eta[0];
  for (int axis = 1; axis < DIM; ++axis)
    along += v[axis] * eta[axis];
  double twice = 2.0 * (double)along;
  for (int axis = 0; axis < DIM; ++axis)
    twice += (double)(REAL)(eta[axis] * eta[axis]);
  double e = (double)v[INVERSE] * twice;
  return e / (sqrt(1.0 + e) + 1.0);
}

/* Add a pull along a bond, N/m^3 */
inline void add_pull(__global const REAL *v, const REAL *eta, double more, SUM *force) {
  for (int axis = 0; axis < DIM; ++axis)
    force[axis] = (REAL)((double)force[axis] + more * (double)(REAL)(v[axis] + eta[axis]));
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
  int b = i / 64, lane = i % 64, first = start[b], end_turn = END_TURN(i);
  for (int axis = 0; axis < DIM; ++axis)
    force[axis] = 0;
#ifdef MATCHING_FORCE
  bool is_pending = last_break[i] == step - 1;
#endif
  for (int turn = FIRST_TURN(i); turn < end_turn; ++turn) {
    int slot = SLOT(turn);
    __global const int *row = slots + 8L * slot;
    long place = (long)((slot - first) / 32) * m + i, own = 64L * slot + lane;
    uint bit = 1u << ((slot - first) % 32);
    REAL w = stiffness[64L * row[5] + lane], most = edge[64L * row[6] + lane];
#ifdef MATCHING_FORCE
    bool is_gone = gone[place] & bit, pulls_again = is_gone && is_pending && broken[own] == step - 1;
#else
    bool is_gone = gone[place] & bit, pulls_again = false;
#endif
    if ((w == 0 && isinf(most)) || (is_gone && !pulls_again)) /* no bond; one of no stiffness breaks like any other */
      continue;
    int way = row[lane / 16];
    int j = way < FAR ? i + way : ids[16L * (way - FAR) + lane % 16];
    __global const REAL *v = vectors + (long)WIDTH * row[4];
    REAL eta[DIM], e = 0;
    for (int axis = 0; axis < DIM; ++axis) {
      eta[axis] = u[axis * m + j] - u[axis * m + i];
      REAL share = fma(v[INVERSE], eta[axis], v[DIM + axis]);
      e = axis == 0 ? share * eta[axis] : fma(share, eta[axis], e);
    }
    REAL size = fabs(e);
#ifdef SOFTENS
    if (!is_gone && soft[place] & bit) {
      w = pull[own];
      most = own_edge[own];
    }
#endif
    if (e > most || pulls_again) {
      double stretch = (double)e / (1.0 + sqrt(1.0 + (double)e));
      REAL highest = peak[64L * row[7] + lane], end = limit[64L * row[7] + lane], whole = stiffness[64L * row[5] + lane];
      REAL last_eta[DIM];
      for (int axis = 0; axis < DIM; ++axis)
        last_eta[axis] = ago(before, u, rate, dt, axis * m + j) - ago(before, u, rate, dt, axis * m + i);
      double last = stretched(v, last_eta);
#ifdef SOFTENS
      double largest = worst[own];
#else
      double largest = 0;
#endif
#ifdef MATCHING_FORCE
      if (pulls_again) {
        double pull_then = SECOND_FORCE(stretch, last, (double)own_edge[own], largest, (double)highest, (double)end);
        add_pull(v, eta, pull_then / (1.0 + stretch) * (double)whole, force);
        own_edge[own] = end;
        torn[b] = 1;
        continue;
      }
      if (stretch > (double)highest) {
        double force_then = MATCHING_FORCE(stretch, last, largest, highest, end);
        add_pull(v, eta, force_then / (1.0 + stretch) * (double)whole, force);
      }
#endif
      if (stretch > (double)end) {
        double c = (double)(REAL)(whole / v[INVERSE]) / 4.0;
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
      w = stiffness[64L * row[5] + lane];
#endif
    REAL along_bond = w * e;
    along_bond *= over_root(e, size);
    for (int axis = 0; axis < DIM; ++axis)
      force[axis] = fma(along_bond, v[axis] + eta[axis], force[axis]);
  }
}

#ifdef TOGETHER
/* Force densities (DIM, TOGETHER) on the nodes from i on, in vectors; false where a bond of theirs is long, has softened,
   has broken one step ago or is over its limit, and nodes are summed one by one. */
inline bool sum_short(FORCE_PARAMETERS, __global const REAL *u, int m, int step, int i, SUM *force) {
  int b = i / 64, lane = i % 64, first = start[b], end_turn = END_TURN(i), word = -1;
  for (int k = i; k < i + TOGETHER; ++k)
    if (last_break[k] == step - 1)
      return false;
  REALS here[DIM], sums[DIM];
  for (int axis = 0; axis < DIM; ++axis) {
    here[axis] = LOAD(u + (long)axis * m + i);
    sums[axis] = 0;
  }
  INTEGERS others = 0;
  BITS lost = 0;
  uint some = 0;
  for (int turn = FIRST_TURN(i); turn < end_turn; ++turn) {
    int slot = SLOT(turn), at = (slot - first) % 32;
    if ((slot - first) / 32 != word) {
      word = (slot - first) / 32;
      long place = (long)word * m + i;
#ifdef SOFTENS
      BITS softened = LOAD(soft + place);
      if (ANY_OF(softened))
        return false;
#endif
      lost = LOAD(gone + place);
      some = ANY_OF(lost);
    }
    __global const int *row = slots + 8L * slot;
    __global const REAL *v = vectors + (long)WIDTH * row[4];
    int way = row[lane / 16];
    REALS w = LOAD(stiffness + 64L * row[5] + lane), most = LOAD(edge + 64L * row[6] + lane), eta[DIM], e = 0;
    if (some >> at & 1) {
      INTEGERS out = WIDENED(TO_INTEGER)((lost >> (uint)at & 1u) != 0u);
      w = select(w, (REALS)0, out);
      most = select(most, (REALS)INFINITY, out);
    }
    for (int axis = 0; axis < DIM; ++axis) {
      __global const REAL *along = u + (long)axis * m;
      eta[axis] = way < FAR ? LOAD(along + i + way) : GATHER(along, ids + 16L * (way - FAR) + lane % 16);
      eta[axis] -= here[axis];
      REALS share = fma((REALS)v[INVERSE], eta[axis], (REALS)v[DIM + axis]);
      e = axis == 0 ? share * eta[axis] : fma(share, eta[axis], e);
    }
    e = select(e, (REALS)0, w == 0 && isinf(most));
    others |= e > most || fabs(e) > (REALS)NARROW;
    REALS pull = w * e;
    pull *= POLYNOMIAL_NARROW(REALS, e);
    for (int axis = 0; axis < DIM; ++axis)
      sums[axis] = fma(pull, (REALS)v[axis] + eta[axis], sums[axis]);
  }
  for (int axis = 0; axis < DIM; ++axis)
    WIDENED(vstore)(sums[axis], 0, force + TOGETHER * axis);
  return !any(others);
}
#endif
