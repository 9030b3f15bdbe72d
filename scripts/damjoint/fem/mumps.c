/* Interface to MUMPS, the sparse direct solver (https://mumps-solver.org); called by factor.py.

   python-mumps, the other interface for Python, has no order of elimination of the user's. */
#include <dmumps_c.h>

/* MUMPS's numbers: jobs, types, orders of elimination; error of this file */
enum { START = -1, END = -2, ANALYSE = 1, FACTORISE = 2, SOLVE = 3 };
enum { SYMMETRIC = 2, SEQUENTIAL = -987654 };
enum { GIVEN = 1, MINIMUM_FILL = 2 };
enum { TOO_LARGE = 1 };

const char *damjoint_mumps_version(void) { return MUMPS_VERSION; }

static int run(DMUMPS_STRUC_C *mumps, int job) {
  mumps->job = job;
  dmumps_c(mumps);
  return mumps->infog[0];
}

/* Solve a symmetric system of n unknowns for `count` right-hand sides, in place. The matrix has its
   upper triangle as entries (row, column: from 1). order (n): position of each unknown in the
   elimination, from 1, or NULL for that of MUMPS. keep (kept): unknowns that are not eliminated;
   their Schur complement (kept, kept) has its lower triangle filled by rows, and the solution is
   that with these unknowns zero. available: memory [MB]; needed: the estimate.
   Returns 0, TOO_LARGE if the estimate exceeds the memory, or the (negative) error of MUMPS. */
int damjoint_solve(int n, long long entries, int *row, int *column, double *value, int *order,
                   int kept, int *keep, double *schur, int count, double *right, double available,
                   double *needed) {
  DMUMPS_STRUC_C mumps = {.par = 1, .sym = SYMMETRIC, .comm_fortran = SEQUENTIAL};
  int error = run(&mumps, START);
  if (error < 0) return error;
  mumps.icntl[0] = mumps.icntl[1] = mumps.icntl[2] = -1; /* no messages */
  mumps.icntl[3] = 0;
  mumps.cntl[0] = 0; /* no pivoting: eliminated unknowns are positive definite */
  mumps.n = n;
  mumps.nnz = entries;
  mumps.irn = row;
  mumps.jcn = column;
  mumps.a = value;
  mumps.icntl[6] = order ? GIVEN : MINIMUM_FILL;
  mumps.perm_in = order;
  if (kept) {
    mumps.icntl[18] = 1;
    mumps.size_schur = kept;
    mumps.listvar_schur = keep;
    mumps.schur = schur;
  }
  error = run(&mumps, ANALYSE);
  *needed = mumps.infog[15];
  if (error >= 0 && *needed > available) error = TOO_LARGE;
  if (error == 0) error = run(&mumps, FACTORISE);
  if (error == 0) {
    mumps.nrhs = count;
    mumps.lrhs = n;
    mumps.rhs = right;
    error = run(&mumps, SOLVE);
  }
  run(&mumps, END);
  return error;
}
