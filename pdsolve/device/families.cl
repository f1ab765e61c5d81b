/* Two passes over families on lattices, and one over fluxes: pdsolve/lattice/families in OpenCL C.

A work item is a node, a work group 64 of them. Products and sums are rounded once where the vectors of the processor
are (fma), and nowhere else. What a law does with a bond is ACCUMULATE, FINISH, BOND_FORCE and MARGIN, whose statements
the host has written from the law. Symbols as in `FamilySlots` or, with SITES, as in `FamilyTiles` or, with FLUXES too,
as in `FluxTiles`; m places; C numbers a bond; WIDTH numbers of a node between the passes.

    own       (., m) constants of nodes for the first pass        nodal   (WIDTH, m)
    given     (DIM, m) forces of a step in which bonds failed, N/m^3
    flags     whether those count; whether a bond may fail        near    (m,) whether one of the node's bonds may
    node      (m,) row of a site's node, or -1
    more      (., ) conductance of the bonds that a surface correction changes, to more_site; those of node n from
              more_start[n] on
*/

#define EACH_BOND                                                                                                      \
  for (int slot = FIRST_SLOT(i); slot < END_SLOT(i); ++slot)                                                           \
    if (bond_of(FORCE_ARGUMENTS, u, m, i, slot, c, &j, &bond))
#define SUM double

typedef struct {
  REAL xi[DIM], eta[DIM], length, stretch, elongation, inverse, q;
} Bond;

/* The numbers c of a bond, and the node j at its other end; false without a bond */
#ifdef SITES
#define ABSENT(i) ((i) >= m || node[i] < 0)
#define FIRST_SLOT(i) 0
#define END_SLOT(i) SLOTS
#define VECTOR(slot) (slot)
#define HAS_BOND(tile, slot, lane) (bits[(long)(tile) * SLOTS + (slot)] >> (lane) & 1)
inline bool numbers_of(FORCE_PARAMETERS, int m, int i, int slot, REAL *c, int *j) {
  int tile = (i - OF_MARGIN) / 16, lane = (i - OF_MARGIN) % 16;
  *j = i + (int)offsets[slot];
#ifdef FLUXES
  c[0] = g[slot];
  if (general[tile]) {
    SHARE
    c[0] = HAS_BOND(tile, slot, lane) ? c[0] : 0;
  }
  return true; /* sums are two in turn; a site without a node has nothing */
#else
  if (!HAS_BOND(tile, slot, lane))
    return false;
  int row = OF_BEYOND + tile / OF_ACROSS, x = OF_PAD + tile % OF_ACROSS * 16 + lane;
  long place = ((long)lines[row] * SLOTS + slot) * OF_WIDE + x;
  long reverse = ((long)lines[row + rows[slot]] * SLOTS + SLOTS - 1 - slot) * OF_WIDE + x + ahead[slot];
  for (int k = 0; k < C; ++k)
    c[k] = numbers[NUMBERS * (k / 2) + (k % 2 ? reverse : place)] * volume[*j];
  return true;
#endif
}
#else
#define ABSENT(i) false
#define FIRST_SLOT(i) start[(i) / 64]
#define END_SLOT(i) start[(i) / 64 + 1]
#define VECTOR(slot) slots[6L * (slot) + 4]
inline bool numbers_of(FORCE_PARAMETERS, int m, int i, int slot, REAL *c, int *j) {
  __global const int *row = slots + 6L * slot;
  int lane = i % 64, kind = row[5], way = row[lane / 16];
  bool there = false;
  for (int k = 0; k < C; ++k) {
    c[k] = kind >= 0 ? kinds[C * kind + k] : rows[((long)(-1 - kind) * C + k) * 64 + lane];
    there = there || c[k] != 0;
  }
  if (there)
    *j = way < FAR ? i + way : ids[16L * (way - FAR) + lane % 16];
  return there;
}
#endif

/* The same, and what its nodes have made of it */
inline bool bond_of(FORCE_PARAMETERS, __global const REAL *u, int m, int i, int slot, REAL *c, int *j, Bond *bond) {
  if (!numbers_of(FORCE_ARGUMENTS, m, i, slot, c, j))
    return false;
#ifndef FLUXES
  __global const REAL *v = vectors + (long)FIELDS * VECTOR(slot);
  REAL e = 0;
  for (int axis = 0; axis < DIM; ++axis) {
    REAL far = u[axis * m + *j];
    bond->xi[axis] = v[axis];
#ifdef SITES
    bond->eta[axis] = far - u[axis * m + i];
#else
    bond->eta[axis] = c[0] != 0 ? far - u[axis * m + i] : far * (REAL)0;
#endif
    e = fma(fma(v[2 * DIM], bond->eta[axis], v[DIM + axis]), bond->eta[axis], e);
  }
  REAL inverse;
  if (fabs(e) <= (REAL)NARROW) {
    bond->stretch = e * POLYNOMIAL_STRETCH(REAL, e);
    inverse = fma(-e, POLYNOMIAL_NARROW(REAL, e), (REAL)1);
  } else {
    REAL q = sqrt((REAL)1 + e);
    bond->stretch = e / (q + (REAL)1);
    inverse = (REAL)1 / q;
  }
  bond->q = (REAL)1 + bond->stretch;
  bond->length = v[2 * DIM + 1];
  bond->elongation = bond->length * bond->stretch;
  bond->inverse = v[2 * DIM + 2] * inverse;
#endif
  return true;
}

/* What the first pass makes of node i */
inline void sum_first(FORCE_PARAMETERS, __global const REAL *u, int m, int i, REAL *between) {
  int j;
  REAL s[SUMS], c[C];
  Bond bond;
  for (int k = 0; k < SUMS; ++k)
    s[k] = 0;
  EACH_BOND {
    ACCUMULATE
  }
  FINISH
}

#ifdef FLUXES
/* The rate of a node at this potential, of which its bonds bring so much: less what leaves it, and with what the few
   bonds of a surface correction add */
inline double rate_of(FORCE_PARAMETERS, __global const REAL *u, int i, double potential, double brought) {
  double rate = brought - total[i] * potential, added[2] = {0, 0};
  long first = more_start[node[i]], last = more_start[node[i] + 1];
  for (long k = first; k < last; ++k)
    added[(k - first) % 2] = fma(more[k], u[more_site[k]], added[(k - first) % 2]);
  rate += added[0] + added[1];
  rate -= more_total[i] * potential;
  return rate;
}
#else
/* Numbers of nodes between the passes */
__kernel __attribute__((reqd_work_group_size(64, 1, 1)))
void first_pass(FORCE_PARAMETERS, __global const REAL *u, int m) {
  int i = get_global_id(0);
  REAL between[WIDTH];
  if (ABSENT(i))
    return;
  sum_first(FORCE_ARGUMENTS, u, m, i, between);
  for (int k = 0; k < WIDTH; ++k)
    nodal[k * m + i] = between[k];
}

/* Which nodes have a bond that may be over its limit */
__kernel __attribute__((reqd_work_group_size(64, 1, 1)))
void watch(FORCE_PARAMETERS, __global const REAL *u, int m) {
  int i = get_global_id(0), j;
  REAL c[C];
  Bond bond;
  if (ABSENT(i))
    return;
  near[i] = 0;
  EACH_BOND {
    MARGIN
  }
}

/* Force density on node i, N/m^3, from the numbers of nodes between the passes */
inline void sum_last(FORCE_PARAMETERS, __global const REAL *u, int m, int i, SUM *force) {
  int j;
  REAL f[DIM], c[C];
  Bond bond;
  for (int axis = 0; axis < DIM; ++axis)
    f[axis] = 0;
  EACH_BOND {
    BOND_FORCE
  }
  for (int axis = 0; axis < DIM; ++axis)
    force[axis] = (double)f[axis];
}

/* Forces of all nodes, for a step in which bonds fail */
__kernel __attribute__((reqd_work_group_size(64, 1, 1)))
void bond_forces(FORCE_PARAMETERS, __global const REAL *u, int m) {
  int i = get_global_id(0);
  SUM force[DIM];
  if (ABSENT(i))
    return;
  sum_last(FORCE_ARGUMENTS, u, m, i, force);
  for (int axis = 0; axis < DIM; ++axis)
    given[axis * m + i] = force[axis];
}
#endif

/* What bonds do to node i: the force density, N/m^3, or what they bring */
inline void sum_bonds(FORCE_PARAMETERS, STEP_PARAMETERS, int i, SUM *sums) {
  if (ABSENT(i))
    return;
#ifdef FLUXES
  sum_first(FORCE_ARGUMENTS, u, m, i, sums);
#else
  if (!flags[0])
    sum_last(FORCE_ARGUMENTS, u, m, i, sums);
  for (int axis = 0; flags[0] && axis < DIM; ++axis)
    sums[axis] = given[axis * m + i];
#endif
}
