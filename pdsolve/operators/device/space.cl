/* Bonds of cubic lattices: pdsolve/operators/space_lattice in OpenCL C.

A work item is a site, a tile 16 of them. Products and sums are rounded once where the processor's vectors are (fma),
and nowhere else. Symbols as in `Tiles`; m sites with margins, `count` offsets.

    intact    (w, m) bits of offsets: the bond of a site is there; 32 a word     kind   (tiles,)
    node      (m,) row of a site's node, or -1                                   held   (m,)
    memory    (tiles,) whether a bond of the tile has softened; torn: since the host looked
    worst     (tiles, count, 16) largest stretch of a bond above its peak, 0 if never there
    breaks    (., 4) site, offset and step of broken bonds, of which `used` counts all: those beyond `room` are lost;
              and one more than the place of the next one of the same site and step, 0 of the last
    stretches (.,) their stretches one step before
    first_break (m,) one more than the place of the first of a site's bonds that broke in the last step in which any did
*/

#define FORCE_PARAMETERS                                                                                               \
  __global const int *offsets, __global const REAL *table, __global const REAL *c, __global const REAL *cells,        \
      __global const uchar *kind, __global const int *node, __global const uchar *held,                                \
      __global const uchar *material, __global const double *peak, __global const double *limit,                      \
      __global uint *intact, __global int *breaks, __global int *used, __global double *dissipated,                   \
      __global int *memory, __global int *torn, __global double *worst, __global double *stretches,                     \
      __global int *first_break
#define SUM REAL
#define ABSENT(i) (node[i] < 0)
#define FORCE_ARGUMENTS                                                                                                \
  offsets, table, c, cells, kind, node, held, material, peak, limit, intact, breaks, used, dissipated, memory, torn,    \
      worst, stretches, first_break
#define INVERSE 6
#define PULL 7
#define SHARES 8
#define ALIKE 1
#define GENERAL 3

inline double stretched(__global const REAL *row, REAL x, REAL y, REAL z) {
  REAL along = row[0] * x + row[1] * y;
  along += row[2] * z;
  REAL square = x * x + y * y;
  square += z * z;
  double e = (double)row[INVERSE] * (2.0 * (double)along + (double)square);
  return e / (sqrt(1.0 + e) + 1.0);
}

inline double stretched_before(__global const REAL *row, double x, double y, double z) {
  double along = (double)row[0] * x + (double)row[1] * y + (double)row[2] * z;
  double e = (double)row[INVERSE] * (2.0 * along + (x * x + y * y + z * z));
  return e / (sqrt(1.0 + e) + 1.0);
}

/* Stiffness over length of a bond, in double precision */
inline double whole_stiffness(__global const REAL *row, __global const REAL *c, __global const REAL *cells, int of,
                              int m, int i, int j) {
  if (of == ALIKE)
    return (double)row[PULL];
  double w = 0;
  for (int axis = 0; axis < 3; ++axis)
    w += (double)row[SHARES + axis] * ((double)c[axis * m + i] + (double)c[axis * m + j]);
  if (of >= GENERAL) {
    REAL both = cells[m + i] + cells[m + j];
    both = cells[j] * both;
    w *= (double)both;
  }
  return w;
}

/* Add the second pulls of the bonds of site i that broke one step ago, N/m^3, to `pulled`. */
inline void pull_again(FORCE_PARAMETERS, __global const REAL *u, __global const REAL *rate, double dt, int m, int step,
                       int i, SUM *pulled) {
  int tile = (i - MARGIN) / 16;
  for (int at = first_break[i]; at > 0; at = breaks[4L * at - 1]) {
    if (breaks[4L * at - 2] != step - 1)
      return;
    int slot = breaks[4L * at - 3], j = i + offsets[slot];
    int pair = PAIRS == 1 ? 0 : MATERIALS * material[i] + material[j];
    __global const REAL *row = table + 12 * slot;
    REAL eta[3];
    double last[3], largest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      eta[axis] = u[axis * m + j] - u[axis * m + i];
      REAL faster = rate[axis * m + j] - rate[axis * m + i];
      last[axis] = (double)eta[axis] - dt * (double)faster;
    }
#ifdef SOFTENS
    largest = worst[((long)tile * COUNT + slot) * 16 + (i - MARGIN) % 16];
#endif
    double stretch = stretched(row, eta[0], eta[1], eta[2]), before = stretched_before(row, last[0], last[1], last[2]);
    double more = SECOND_FORCE(stretch, before, stretches[at - 1], largest, peak[COUNT * pair + slot],
                              limit[COUNT * pair + slot]);
    more *= whole_stiffness(row, c, cells, kind[tile], m, i, j) / (1.0 + stretch);
    for (int axis = 0; axis < 3; ++axis)
      pulled[axis] = (REAL)((double)pulled[axis] + more * (double)(REAL)(row[axis] + eta[axis]));
  }
}

inline void sum_bonds(FORCE_PARAMETERS, __global const REAL *before, __global const REAL *u, __global const REAL *rate,
                      double dt, int m, int step, int i, SUM *force) {
  REAL sums[3] = {0, 0, 0};
  SUM pulled[3] = {0, 0, 0}; /* the last pulls of bonds that break */
  int tile = (i - MARGIN) / 16, of = kind[tile], broken_before = 0;
  pull_again(FORCE_ARGUMENTS, u, rate, dt, m, step, i, pulled);
  for (int slot = 0; slot < COUNT; ++slot) {
    long place = (long)(slot / 32) * m + i, own = ((long)tile * COUNT + slot) * 16 + (i - MARGIN) % 16;
    int j = i + offsets[slot];
    uint bit = 1u << (slot % 32);
    if (!(intact[place] & bit))
      continue;
    __global const REAL *row = table + 12 * slot;
    REAL eta[3], e = 0;
    for (int axis = 0; axis < 3; ++axis) {
      eta[axis] = u[axis * m + j] - u[axis * m + i];
      e = fma(fma(row[INVERSE], eta[axis], row[3 + axis]), eta[axis], e);
    }
    REAL g;
    int pair = PAIRS == 1 ? 0 : MATERIALS * material[i] + material[j];
    if (fabs(e) > (REAL)NEAR) {
      double highest = peak[COUNT * pair + slot], most = limit[COUNT * pair + slot];
      double stretch = stretched(row, eta[0], eta[1], eta[2]);
      bool ages = stretch > highest && !held[i] && !held[j];
      double whole = 0, ago = 0, largest = 0;
      if (ages) {
        double last[3];
        for (int axis = 0; axis < 3; ++axis) {
          REAL faster = rate[axis * m + j] - rate[axis * m + i];
          last[axis] = (double)eta[axis] - dt * (double)faster;
        }
#ifdef SOFTENS
        largest = worst[own];
#endif
        whole = whole_stiffness(row, c, cells, of, m, i, j);
        ago = stretched_before(row, last[0], last[1], last[2]);
        if (stretch > largest) {
          double more = MATCHING_FORCE(stretch, ago, largest, highest, most) * (whole / (1.0 + stretch));
          for (int axis = 0; axis < 3; ++axis)
            pulled[axis] = (REAL)((double)pulled[axis] + more * (double)(REAL)(row[axis] + eta[axis]));
        }
      }
      if (ages && stretch > most) {
        double stiffness = whole / (double)row[INVERSE] / 4.0;
        if (ago < most)
          dissipated[i] += TOTAL_DISSIPATED(stiffness, highest, most);
        else
          dissipated[i] += DISSIPATED_AT_BREAK(stiffness, stretch, ago, highest, most);
        intact[place] &= ~bit;
        int at = atomic_inc(used);
        if (at < ROOM) {
          breaks[4L * at] = i;
          breaks[4L * at + 1] = slot;
          breaks[4L * at + 2] = step;
          breaks[4L * at + 3] = 0;
          stretches[at] = ago < stretch ? ago : most;
          if (broken_before > 0)
            breaks[4L * broken_before - 1] = at + 1;
          else
            first_break[i] = at + 1;
          broken_before = at + 1;
        }
        continue;
      }
#ifdef SOFTENS
      if (ages && stretch > worst[own]) {
        worst[own] = stretch;
        memory[tile] = torn[tile] = 1;
      }
#endif
      REAL q2 = (REAL)1 + e;
      g = fabs(e) <= (REAL)WIDE ? POLYNOMIAL_WIDE(REAL, e) : (REAL)1 / (q2 + sqrt(q2));
    } else {
      g = POLYNOMIAL_NARROW(REAL, e);
    }
    REAL w = row[PULL];
    if (of != ALIKE) {
      w = row[SHARES] * (c[j] + c[i]);
      for (int axis = 1; axis < 3; ++axis)
        w = fma(row[SHARES + axis], c[axis * m + j] + c[axis * m + i], w);
      if (of >= GENERAL) {
        w *= cells[j];
        w *= cells[m + j] + cells[m + i];
      }
    }
#ifdef SOFTENS
    if (memory[tile] && worst[own] > 0 && e > (REAL)FLOOR)
      w *= (REAL)SECANT(worst[own], worst[own], peak[COUNT * pair + slot], limit[COUNT * pair + slot]);
#endif
    REAL eg = e * g, pull = w * eg;
    for (int axis = 0; axis < 3; ++axis)
      sums[axis] = fma(pull, row[axis] + eta[axis], sums[axis]);
  }
  for (int axis = 0; axis < 3; ++axis)
    force[axis] = sums[axis] + pulled[axis];
}

#ifdef TOGETHER
/* Force densities (DIM, TOGETHER) on the sites from i on, in vectors; false where there is no node, or a bond of theirs
   is long, has broken one step ago or is of a tile with softened ones, and sites are summed one by one. */
inline bool sum_short(FORCE_PARAMETERS, __global const REAL *u, int m, int step, int i, SUM *force) {
  for (int k = i; k < i + TOGETHER; ++k)
    if (first_break[k] > 0 && breaks[4L * first_break[k] - 2] == step - 1)
      return false;
  if (all(LOAD(node + i) < 0))
    return false;
  int tile = (i - MARGIN) / 16, of = kind[tile];
#ifdef SOFTENS
  if (memory[tile])
    return false;
#endif
  REALS here[3], corrected[3], sums[3];
  for (int axis = 0; axis < 3; ++axis) {
    here[axis] = LOAD(u + (long)axis * m + i);
    corrected[axis] = LOAD(c + (long)axis * m + i);
    sums[axis] = 0;
  }
  REALS half_modulus = LOAD(cells + m + i);
  INTEGERS others = 0;
  BITS there = 0;
  uint every = 0;
  for (int slot = 0; slot < COUNT; ++slot) {
    int at = slot % 32, j = i + offsets[slot];
    if (at == 0) {
      there = LOAD(intact + (long)(slot / 32) * m + i);
      every = ALL_OF(there);
    }
    __global const REAL *row = table + 12 * slot;
    REALS eta[3], e = 0;
    for (int axis = 0; axis < 3; ++axis) {
      eta[axis] = LOAD(u + (long)axis * m + j) - here[axis];
      e = fma(fma((REALS)row[INVERSE], eta[axis], (REALS)row[3 + axis]), eta[axis], e);
    }
    REALS w = row[PULL];
    if (of != ALIKE) {
      w = (REALS)row[SHARES] * (LOAD(c + j) + corrected[0]);
      for (int axis = 1; axis < 3; ++axis)
        w = fma((REALS)row[SHARES + axis], LOAD(c + (long)axis * m + j) + corrected[axis], w);
      if (of >= GENERAL) {
        w *= LOAD(cells + j);
        w *= LOAD(cells + m + j) + half_modulus;
      }
    }
    if (!(every >> at & 1)) {
      INTEGERS out = WIDENED(TO_INTEGER)((there >> (uint)at & 1u) == 0u);
      w = select(w, (REALS)0, out);
      e = select(e, (REALS)0, out);
    }
    others |= fabs(e) > (REALS)NEAR;
    REALS eg = e * POLYNOMIAL_NARROW(REALS, e), pull = w * eg;
    for (int axis = 0; axis < 3; ++axis)
      sums[axis] = fma(pull, (REALS)row[axis] + eta[axis], sums[axis]);
  }
  for (int axis = 0; axis < 3; ++axis)
    for (int k = 0; k < TOGETHER; ++k)
      force[TOGETHER * axis + k] = ((REAL *)&sums[axis])[k];
  return !any(others);
}
#endif
