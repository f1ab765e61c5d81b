/* Two passes over families on lattices: pdsolve/lattice/families in OpenCL C.

A work item is a node, a work group a block of 64. Products and sums are rounded once where the vectors of the processor
are (fma), and nowhere else. What a law does with a bond is ACCUMULATE, FINISH, BOND_FORCE and MARGIN, whose statements
the host has written from the law. Symbols as in `FamilySlots`; m nodes in whole blocks; C numbers a bond; WIDTH
numbers of a node between the passes.

    own       (., m) constants of nodes for the first pass        nodal   (WIDTH, m)
    given     (DIM, m) forces of a step in which bonds failed, N/m^3
    flags     whether those count; whether a bond may fail        near    (m,) whether one of the node's bonds may
*/

#define EACH_BOND                                                                                                      \
  for (int slot = start[i / 64]; slot < start[i / 64 + 1]; ++slot)                                                     \
    if (bond_of(FORCE_ARGUMENTS, u, m, i, slot, c, &j, &bond))
#define SUM double
#define ABSENT(i) false

typedef struct {
  REAL xi[DIM], eta[DIM], length, stretch, elongation, inverse, q;
} Bond;

/* The numbers of a bond, and the node at its other end; false without a bond */
inline bool bond_of(FORCE_PARAMETERS, __global const REAL *u, int m, int i, int slot, REAL *c, int *j, Bond *bond) {
  __global const int *row = slots + 6L * slot;
  int lane = i % 64, kind = row[5], way = row[lane / 16];
  bool there = false;
  for (int k = 0; k < C; ++k) {
    c[k] = kind >= 0 ? kinds[C * kind + k] : rows[((long)(-1 - kind) * C + k) * 64 + lane];
    there = there || c[k] != 0;
  }
  if (!there)
    return false;
  *j = way < FAR ? i + way : ids[16L * (way - FAR) + lane % 16];
  __global const REAL *v = vectors + (long)FIELDS * row[4];
  REAL e = 0;
  for (int axis = 0; axis < DIM; ++axis) {
    REAL far = u[axis * m + *j];
    bond->xi[axis] = v[axis];
    bond->eta[axis] = c[0] != 0 ? far - u[axis * m + i] : far * (REAL)0;
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
  return true;
}

/* Numbers of nodes between the passes */
__kernel __attribute__((reqd_work_group_size(64, 1, 1)))
void first_pass(FORCE_PARAMETERS, __global const REAL *u, int m) {
  int i = get_global_id(0), j;
  REAL s[SUMS], c[C];
  Bond bond;
  for (int k = 0; k < SUMS; ++k)
    s[k] = 0;
  EACH_BOND {
    ACCUMULATE
  }
  FINISH
}

/* Which nodes have a bond that may be over its limit */
__kernel __attribute__((reqd_work_group_size(64, 1, 1)))
void watch(FORCE_PARAMETERS, __global const REAL *u, int m) {
  int i = get_global_id(0), j;
  REAL c[C];
  Bond bond;
  near[i] = 0;
  EACH_BOND {
    MARGIN
  }
}

/* Force density on node i, N/m^3, from the numbers of nodes between the passes */
inline void exchanged(FORCE_PARAMETERS, __global const REAL *u, int m, int i, SUM *force) {
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
  exchanged(FORCE_ARGUMENTS, u, m, i, force);
  for (int axis = 0; axis < DIM; ++axis)
    given[axis * m + i] = force[axis];
}

inline void sum_bonds(FORCE_PARAMETERS, __global const REAL *before, __global const REAL *u, __global const REAL *rate,
                      double dt, int m, int step, int i, SUM *force) {
  if (!flags[0])
    exchanged(FORCE_ARGUMENTS, u, m, i, force);
  for (int axis = 0; flags[0] && axis < DIM; ++axis)
    force[axis] = given[axis * m + i];
}
