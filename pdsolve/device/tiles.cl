/* Bonds of lattices under a pair law of straight lines: pdsolve/lattice in OpenCL C.

A work item sums the bonds of TOGETHER nodes, one after the other in memory, slot by slot in the order of the processor,
and alone changes what their bonds remember. Products and sums are rounded once where the processor's vectors are (fma),
and nowhere else. A group shares its slots: with SITES it is a tile of 16 sites, whose slots are offsets from site to
site (symbols as in `Tiles`); else a block of 64 nodes (symbols as in `Blocks`). m sites or nodes, idle ones included.

    turn      a slot of the group; in space a place in `of_rows`, where the slots of rows of 16 nodes are
    intact    (w, m) bits of the slots of a node's group: its bond there is intact; 32 a word
    memory    (groups,) 0, or 1 from when a bond of the group has softened, 2 if one has since the host looked
    worst     (groups, slots, 16 or 64) largest stretch of a bond above its peak, 0 if never there; own_edge its e then
    breaks    (., 4) node, slot and step of broken bonds, of which `used` counts all: those beyond ROOM are lost;
              and one more than the place of the next one of the same node and step, 0 of the last
    stretches (.,) their stretches one step before
    first_break (m,) one more than the place of the first of a node's bonds that broke in the last step in which any did
*/

#define SUM REAL
#define RATIO(e) ((e) / (sqrt(1.0 + (e)) + 1.0))
#define LIMITS(of, slot, i) ((double)of[LIMIT_ROW(slot, i)])
#ifdef SOFTENS
#define LARGEST(slot, i) (memory[GROUP(i)] ? (double)worst[OWN(slot, i)] : 0.0)
#else
#define LARGEST(slot, i) 0.0
#endif

#ifdef SITES
#define HISTORY double
#define IN_ORDER false /* whether a pull is added in the turn of its slot, or behind all */
#define ABSENT(i) ((i) >= m || node[i] < 0)
#define GROUP(i) (((i) - MARGIN) / 16)
#define FIRST_SLOT(i) 0
#define FIRST_TURN(i) 0
#define END_TURN(i) COUNT
#define SLOT(turn) (turn)
#define ROW(slot) (vectors + 12 * (slot))
#define WAY(slot, i) offsets[slot]
#define NEIGHBOUR(slot, i) ((i) + offsets[slot])
#define LOAD_FAR(from, i, way) LOAD((from) + ((i) + (way)))
#define OWN(slot, i) (((long)GROUP(i) * COUNT + (slot)) * 16 + ((i) - MARGIN) % 16)
#define STIFFNESS(slot, way, i) stiffness_of(FORCE_ARGUMENTS, m, slot, (i) + (way), &own)
#define LIMIT_ROW(slot, i) \
  (COUNT * (PAIRS == 1 ? 0 : MATERIALS * material[i] + material[NEIGHBOUR(slot, i)]) + (slot))
#define IS_LONG(e, slot, i) (fabs(e) > (REALS)NEAR)
#define IS_OVER(e, slot, i) (fabs(e) > (REAL)NEAR && !unbreakable[i] && !unbreakable[NEIGHBOUR(slot, i)])
#define IS_LARGEST(stretch, largest) ((stretch) > (largest))
#define ALONG_BOND(w, e, g) ((w) * ((e) * (g)))
#define PULL_AT(force, whole, stretch) ((force) * ((whole) / (1.0 + (stretch))))
#define WEAKENED(w, share) ((w) * (REAL)(share))
/* A limit of the stretches of some nodes' bonds in a slot, of one material; infinite where they are unbreakable */
#define LIMITS_OF_LANES(of, slot, way, i) \
  ((LOAD(cells + 2L * m + (i)) + LOAD(cells + 2L * m + (i) + (way))) + (REALS)(REAL)of[slot])
#else
#define HISTORY REAL
#define IN_ORDER true
#define ABSENT(i) false
#define GROUP(i) ((i) / 64)
#define FIRST_SLOT(i) start[(i) / 64]
#if DIM == 2
#define FIRST_TURN(i) start[(i) / 64]
#define END_TURN(i) start[(i) / 64 + 1]
#define SLOT(turn) (turn)
#else
#define FIRST_TURN(i) start_of_rows[(i) / 16]
#define END_TURN(i) start_of_rows[(i) / 16 + 1]
#define SLOT(turn) of_rows[turn]
#endif
#define AT(slot, of, i) (64L * slots[8L * (slot) + (of)] + (i) % 64)
#define ROW(slot) (vectors + (long)(DIM == 2 ? 8 : 9) * slots[8L * (slot) + 4])
#define WAY(slot, i) slots[8L * (slot) + (i) % 64 / 16]
#define LISTED(i, way) (ids + 16L * ((way) - FAR) + (i) % 16)
#define NEIGHBOUR(slot, i) (WAY(slot, i) < FAR ? (i) + WAY(slot, i) : *LISTED(i, WAY(slot, i)))
#define LOAD_FAR(from, i, way) ((way) < FAR ? LOAD((from) + ((i) + (way))) : GATHER(from, LISTED(i, way)))
#define OWN(slot, i) (64L * (slot) + (i) % 64)
#define STIFFNESS(slot, way, i) LOAD(stiffness + AT(slot, 5, i))
#define LIMIT_ROW(slot, i) AT(slot, 7, i)
#define IS_LONG(e, slot, i) (fabs(e) > (REALS)NEAR || (e) > LOAD(edge + AT(slot, 6, i)))
#define IS_OVER(e, slot, i) ((e) > (LARGEST(slot, i) > 0 ? own_edge[OWN(slot, i)] : edge[AT(slot, 6, i)]))
#define IS_LARGEST(stretch, largest) true
#define ALONG_BOND(w, e, g) ((w) * (e) * (g))
#define PULL_AT(force, whole, stretch) ((force) / (1.0 + (stretch)) * (whole))
#define WEAKENED(w, share) ((REAL)((share) * (double)(w)))
#define LIMITS_OF_LANES(of, slot, way, i) LOAD(of + LIMIT_ROW(slot, i))
#endif
#define INVERSE (2 * DIM)
#define PULL (INVERSE + 1)
#define SHARES (INVERSE + 2)
#define ALIKE 1
#define GENERAL 3

/* Stiffness over length of the bonds of some nodes in a slot before any softened, from the numbers of their own end */
#ifdef SITES
typedef struct {
  int kind;
  REALS c[DIM], modulus;
} Ends;

inline REALS stiffness_of(FORCE_PARAMETERS, int m, int slot, int j, const Ends *own) {
  __global const REAL *row = ROW(slot);
  if (own->kind == ALIKE)
    return (REALS)row[PULL];
  REALS w = (REALS)row[SHARES] * (LOAD(c + j) + own->c[0]);
  for (int axis = 1; axis < DIM; ++axis)
    w = fma((REALS)row[SHARES + axis], LOAD(c + (long)axis * m + j) + own->c[axis], w);
  if (own->kind >= GENERAL) {
    w *= LOAD(cells + j);
    w *= LOAD(cells + m + j) + own->modulus;
  }
  return w;
}
#endif

/* The same of one bond in double precision, for what breaks or softens */
inline double whole_stiffness(FORCE_PARAMETERS, int m, int slot, int i, int j) {
#ifdef SITES
  __global const REAL *row = ROW(slot);
  int of = kind[GROUP(i)];
  if (of == ALIKE)
    return (double)row[PULL];
  double w = 0;
  for (int axis = 0; axis < DIM; ++axis)
    w += (double)row[SHARES + axis] * ((double)c[axis * m + i] + (double)c[axis * m + j]);
  REAL both = cells[m + i] + cells[m + j];
  both = cells[j] * both;
  return of >= GENERAL ? w * (double)both : w;
#else
  return (double)stiffness[AT(slot, 5, i)];
#endif
}

typedef struct {
  REAL eta[DIM];
  double stretch, before, whole; /* stretches now and one step ago; stiffness over length */
} Bond;

/* The bond of a node in a slot */
inline Bond bond_of(FORCE_PARAMETERS, STEP_PARAMETERS, int slot, int i) {
  Bond bond;
  __global const REAL *row = ROW(slot);
  int j = NEIGHBOUR(slot, i);
  bond.whole = whole_stiffness(FORCE_ARGUMENTS, m, slot, i, j);
  for (int axis = 0; axis < DIM; ++axis)
    bond.eta[axis] = u[axis * m + j] - u[axis * m + i];
#ifdef SITES
  REAL along = 0, square = 0;
  double along_before = 0, square_before = 0;
  for (int axis = 0; axis < DIM; ++axis) {
    REAL faster = rate[axis * m + j] - rate[axis * m + i];
    double last = (double)bond.eta[axis] - dt * (double)faster;
    along += row[axis] * bond.eta[axis];
    square += bond.eta[axis] * bond.eta[axis];
    along_before += (double)row[axis] * last;
    square_before += last * last;
  }
  double e = (double)row[INVERSE] * (2.0 * (double)along + (double)square);
  double e_before = (double)row[INVERSE] * (2.0 * along_before + square_before);
#else
  REAL e = 0, last[DIM], along_before = 0;
  for (int axis = 0; axis < DIM; ++axis) {
    e = fma(fma(row[INVERSE], bond.eta[axis], row[DIM + axis]), bond.eta[axis], e);
    last[axis] = before[axis * m + j] - before[axis * m + i];
    along_before += row[axis] * last[axis];
  }
  double e_before = 2.0 * (double)along_before;
  for (int axis = 0; axis < DIM; ++axis)
    e_before += (double)(REAL)(last[axis] * last[axis]);
  e_before *= (double)row[INVERSE];
#endif
  bond.stretch = RATIO((double)e);
  bond.before = RATIO(e_before);
  return bond;
}

/* Add a force over stiffness along a bond, N/m^3, to that of its node among TOGETHER of them */
inline void add_pull(const Bond *bond, __global const REAL *row, double force, REAL *pulled) {
  double pull = PULL_AT(force, bond->whole, bond->stretch);
  for (int axis = 0; axis < DIM; ++axis)
    pulled[TOGETHER * axis] =
        (REAL)((double)pulled[TOGETHER * axis] + pull * (double)(REAL)(row[axis] + bond->eta[axis]));
}

/* Add the second pull of a bond of node i that broke one step ago */
inline void pull_again(FORCE_PARAMETERS, STEP_PARAMETERS, int at, int i, REAL *pulled) {
  int slot = breaks[4L * at - 3];
  Bond bond = bond_of(FORCE_ARGUMENTS, STEP_ARGUMENTS, slot, i);
  double highest = LIMITS(peak, slot, i), most = LIMITS(limit, slot, i), first = stretches[at - 1];
  double force = SECOND_FORCE(bond.stretch, bond.before, first, LARGEST(slot, i), highest, most);
  add_pull(&bond, ROW(slot), force, pulled);
}

/* Take out a bond of node i that breaks */
inline void take_out(FORCE_PARAMETERS, int m, int step, int slot, int i, double last) {
  int number = slot - FIRST_SLOT(i), at = atomic_inc(used);
  intact[(long)(number / 32) * m + i] &= ~(1u << (number % 32));
  if (at >= ROOM)
    return;
  __global int *link = first_break + i;
  while (*link > 0 && breaks[4L * *link - 2] == step)
    link = breaks + 4L * *link - 1;
  breaks[4L * at] = i;
  breaks[4L * at + 1] = slot;
  breaks[4L * at + 2] = step;
  breaks[4L * at + 3] = 0;
  stretches[at] = (HISTORY)last;
  *link = at + 1;
}

/* Let the bond of node i in a slot, at e, soften or break where it is over its peak, and add the pull that matches its
   work; its factor g, and what is left of its stiffness over length w. */
inline void update_bond(FORCE_PARAMETERS, STEP_PARAMETERS, int slot, int i, REAL e, REAL *w, REAL *g, REAL *pulled) {
  double highest = LIMITS(peak, slot, i), most = LIMITS(limit, slot, i), largest = LARGEST(slot, i);
  if (IS_OVER(e, slot, i)) {
    Bond bond = bond_of(FORCE_ARGUMENTS, STEP_ARGUMENTS, slot, i);
    if (bond.stretch > highest && IS_LARGEST(bond.stretch, largest)) {
      add_pull(&bond, ROW(slot), ADDED_FORCE(bond.stretch, bond.before, largest, highest, most), pulled);
      if (bond.stretch > most) {
        double stiffness_times_length = (double)(HISTORY)(bond.whole / (double)ROW(slot)[INVERSE]);
        dissipated[i] += BROKEN_ENERGY(stiffness_times_length / 4.0, bond.stretch, bond.before, highest, most);
        take_out(FORCE_ARGUMENTS, m, step, slot, i, bond.before < most ? bond.before : most);
        *w = 0;
        return;
      }
#ifdef SOFTENS
      worst[OWN(slot, i)] = (HISTORY)bond.stretch;
      memory[GROUP(i)] = 2;
#ifndef SITES
      own_edge[OWN(slot, i)] = e;
#endif
#endif
    }
  }
#if defined(SOFTENS) && !defined(CURVED)
  largest = LARGEST(slot, i);
  if (largest > 0 && e > (REAL)FLOOR)
    *w = WEAKENED(*w, SECANT(largest, largest, highest, most));
#endif
  REAL q2 = (REAL)1 + e, size = fabs(e);
  if (size > (REAL)NEAR)
    *g = size <= (REAL)WIDE ? POLYNOMIAL_WIDE(REAL, e) : (REAL)1 / (q2 + sqrt(q2));
}

/* Force densities (DIM, TOGETHER) on the nodes from i on, N/m^3, whose bonds that broke one step ago are `pending`;
   bonds over their limit break in this step, those over their peak soften. Without `care` for each bond none does, and
   it is returned whether one may have to. */
inline bool sum_slots(FORCE_PARAMETERS, STEP_PARAMETERS, bool care, const int *pending, int i, REAL *force) {
  REALS here[DIM], sums[DIM];
  REAL pulled[DIM * TOGETHER], es[TOGETHER], ws[TOGETHER], gs[TOGETHER];
  for (int axis = 0; axis < DIM; ++axis) {
    here[axis] = LOAD(u + (long)axis * m + i);
    sums[axis] = 0;
    for (int k = 0; k < TOGETHER; ++k)
      pulled[TOGETHER * axis + k] = 0;
  }
#ifdef SITES
  for (int k = 0; care && k < TOGETHER; ++k)
    for (int at = pending[k]; at > 0; at = breaks[4L * at - 1])
      pull_again(FORCE_ARGUMENTS, STEP_ARGUMENTS, at, i + k, pulled + k);
  Ends own;
  own.kind = kind[GROUP(i)];
  own.modulus = LOAD(cells + m + i);
  for (int axis = 0; axis < DIM; ++axis)
    own.c[axis] = LOAD(c + (long)axis * m + i);
#endif
  INTEGERS others = 0;
  BITS there = 0;
  uint every = 0;
  int word = -1, end_turn = END_TURN(i);
  for (int turn = FIRST_TURN(i); turn < end_turn; ++turn) {
    int slot = SLOT(turn), number = slot - FIRST_SLOT(i), at = number % 32, way = WAY(slot, i);
    if (number / 32 != word) {
      word = number / 32;
      there = LOAD(intact + (long)word * m + i);
      every = ALL_OF(there);
    }
    __global const REAL *row = ROW(slot);
    REALS eta[DIM], e = 0, w = STIFFNESS(slot, way, i);
    for (int axis = 0; axis < DIM; ++axis) {
      eta[axis] = LOAD_FAR(u + (long)axis * m, i, way) - here[axis];
      e = fma(fma((REALS)row[INVERSE], eta[axis], (REALS)row[DIM + axis]), eta[axis], e);
    }
    if (!(every >> at & 1)) {
      INTEGERS out = AS_WIDE((there >> (uint)at & 1u) == 0u);
      w = select(w, (REALS)0, out);
      e = select(e, (REALS)0, out);
    }
    others |= IS_LONG(e, slot, i);
    REALS g = POLYNOMIAL_NARROW(REALS, e);
#ifdef CURVED
    REAL largest[TOGETHER];
    for (int k = 0; k < TOGETHER; ++k)
      largest[k] = 0;
#endif
    if (care) {
      STORE(e, es);
      STORE(w, ws);
      STORE(g, gs);
      for (int axis = 0; IN_ORDER && axis < DIM; ++axis)
        STORE(sums[axis], pulled + TOGETHER * axis);
      for (int k = 0; k < TOGETHER; ++k) {
        if (intact[(long)word * m + i + k] >> at & 1)
          update_bond(FORCE_ARGUMENTS, STEP_ARGUMENTS, slot, i + k, es[k], ws + k, gs + k, pulled + k);
        for (int last = IN_ORDER ? pending[k] : 0; last > 0; last = breaks[4L * last - 1])
          if (breaks[4L * last - 3] == slot)
            pull_again(FORCE_ARGUMENTS, STEP_ARGUMENTS, last, i + k, pulled + k);
      }
      w = LOAD(ws);
      g = LOAD(gs);
#ifdef CURVED
      for (int k = 0; k < TOGETHER; ++k)
        largest[k] = (REAL)LARGEST(slot, i + k);
#endif
      for (int axis = 0; IN_ORDER && axis < DIM; ++axis)
        sums[axis] = LOAD(pulled + TOGETHER * axis);
    }
#ifdef CURVED
    w *= secant_of_lanes(e * g * sqrt((REALS)1 + e), LOAD(largest), LIMITS_OF_LANES(peak, slot, way, i),
                         LIMITS_OF_LANES(limit, slot, way, i));
#endif
    REALS pull = ALONG_BOND(w, e, g);
    for (int axis = 0; axis < DIM; ++axis)
      sums[axis] = fma(pull, (REALS)row[axis] + eta[axis], sums[axis]);
  }
  for (int axis = 0; axis < DIM; ++axis) {
    REALS more = LOAD(pulled + TOGETHER * axis);
    STORE(IN_ORDER ? sums[axis] : sums[axis] + more, force + TOGETHER * axis);
  }
  return ANY(others);
}

/* The same, with care where a bond needs it; a work item of one node takes it at once */
inline void sum_bonds(FORCE_PARAMETERS, STEP_PARAMETERS, int i, REAL *force) {
  int pending[TOGETHER], absent = 1, care = TOGETHER == 1;
  for (int k = 0; k < TOGETHER; ++k)
    absent &= ABSENT(i + k);
  if (absent)
    return;
  for (int k = 0; k < TOGETHER; ++k) {
    int first = first_break[i + k]; /* one more than the place of a bond, or 0 */
    care |= pending[k] = first > 0 && breaks[4L * first - 2] == step - 1 ? first : 0;
  }
#ifdef SOFTENS
  care |= memory[GROUP(i)];
#endif
  if (care || sum_slots(FORCE_ARGUMENTS, STEP_ARGUMENTS, false, pending, i, force))
    sum_slots(FORCE_ARGUMENTS, STEP_ARGUMENTS, true, pending, i, force);
}
