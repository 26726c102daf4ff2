"""The triangular factor R of [W Y], from which every linear estimate is computed.

    [W Y] = Q R,    R = [[R_11, r_12], [0, r_22]]

    X = R_11^-1 r_12          eq. (7)          ||Y - W X|| = |r_22|
    (W'W)^-1 = R_11^-1 R_11^-T                 cond(W) = cond(R_11)

Q is never formed. Rows are joint-major and the torque of joint j depends on few parameters, so each
joint is factored on its own nonzero columns C_j and the small factors are stacked and factored once
more (structured TSQR):

    R_j = R factor of [W_j[:, C_j] Y_j],    R = R factor of the stacked R_j,
                                            ||Y_j - W_j X|| = ||R_j [X[C_j]; -1]||

Weights of a joint multiply R_j, removing a parameter deletes a column of R and of the R_j, and
parts of a record are combined by stacking their R_j. None of these operations uses W again.

References: Golub and Van Loan, Matrix Computations, sections 5.2 and 6.5; Demmel, Grigori, Hoemmen
and Langou (2012) for TSQR.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

Array = np.ndarray


def triangularise(A: Array) -> Array:
    """Compute the upper triangular factor R of A = Q R, so that R'R = A'A; A has the shape (m, n).

    m < n is allowed.
    """
    m, n = A.shape
    R = np.zeros((n, n))
    if m:
        R[: min(m, n)] = np.linalg.qr(A, mode="r")
    return R


@dataclass(frozen=True)
class JointFactor:
    """Triangular factor R_j of the rows [W_j Y_j] of one joint; zero columns of W_j are left out.

    R'R is the Gram matrix of [W_j[:, columns] Y_j].

    columns : ndarray of int, shape (c,), indices in the names of the Factor.
    R : ndarray, shape (k, c + 1), k <= c + 1 after factoring; not triangular once columns were
    deleted.
    rows : number of rows of this joint.
    """

    columns: Array
    R: Array
    rows: int

    def spread(self, b: int) -> Array:
        """Return the factor R_j of this joint with a column for each of all b parameters and for Y.

        Parameters that do not act on the joint get zero columns. R_j has k rows, so the shape is
        (k, b + 1).
        """
        block = np.zeros((len(self.R), b + 1))
        block[:, [*self.columns, b]] = self.R
        return block

    def residual_norm(self, X: Array) -> float:
        """Compute the norm ||Y_j - W_j X|| of the residuals of this joint for parameters X."""
        return float(np.linalg.norm(self.R[:, :-1] @ X[self.columns] - self.R[:, -1]))

    @property
    def measured_norm(self) -> float:
        """Norm ||Y_j|| of the measured torques of this joint."""
        return float(np.linalg.norm(self.R[:, -1]))


@dataclass(frozen=True)
class Factor:
    """Triangular (QR) factor R of the matrix [W Y], and the factor of the rows of each joint.

    names : the b parameters, in column order.
    R : ndarray, shape (b + 1, b + 1), upper triangular.
    joints : one JointFactor per joint.
    """

    names: tuple[str, ...]
    R: Array
    joints: tuple[JointFactor, ...]

    @classmethod
    def of(cls, names: Sequence[str], joints: Sequence[JointFactor]) -> Factor:
        """Combine the triangular factors of all joints into the triangular factor of [W Y]."""
        b = len(names)
        R = (
            triangularise(np.vstack([joint.spread(b) for joint in joints]))
            if joints
            else np.zeros((b + 1, b + 1))
        )
        return cls(tuple(names), R, tuple(joints))

    @property
    def rows(self) -> int:
        """Number of rows r of W."""
        return sum(joint.rows for joint in self.joints)

    @property
    def R11(self) -> Array:
        """Upper triangular factor R_11 of W, shape (b, b)."""
        return self.R[:-1, :-1]

    @property
    def r12(self) -> Array:
        """Vector r_12 = Q'Y, shape (b,), with W = Q R_11: the component of Y in the range of W."""
        return self.R[:-1, -1]

    @property
    def r22(self) -> float:
        """Norm of the component of Y outside the range of W."""
        return float(abs(self.R[-1, -1]))

    def weighted(self, weights: Sequence[float] | Array) -> Factor:
        """Return the triangular factor of [W Y] with the rows of joint j scaled by weights[j]."""
        return Factor.of(
            self.names,
            [replace(joint, R=joint.R * w) for joint, w in zip(self.joints, weights, strict=True)],
        )

    def select(self, names: Sequence[str]) -> Factor:
        """Return the triangular factor of [W Y] for the columns `names` of W, in this order."""
        unknown = [name for name in names if name not in self.names]
        if unknown:
            raise ValueError(
                f"no columns {', '.join(unknown)}; the factor has {', '.join(self.names)}"
            )
        kept = [self.names.index(name) for name in names]
        R = triangularise(self.R[:, [*kept, len(self.names)]])
        return Factor(tuple(names), R, tuple(selected(joint, kept) for joint in self.joints))

    def drop(self, name: str) -> Factor:
        """Return the triangular factor of [W Y] without the column of one parameter.

        Without column k, R stays triangular above row k. Only the trailing block, an upper
        Hessenberg matrix of order b - k, is made triangular again.
        """
        k = self.names.index(name)
        b = len(self.names)
        kept = [i for i in range(b) if i != k]
        R = np.zeros((b, b))
        R[:k] = np.delete(self.R[:k], k, axis=1)
        R[k:, k:] = triangularise(self.R[k:, k + 1 :])
        return Factor(
            tuple(self.names[i] for i in kept),
            R,
            tuple(selected(joint, kept) for joint in self.joints),
        )


def selected(joint: JointFactor, kept: Sequence[int]) -> JointFactor:
    """Reduce the triangular factor R_j of one joint to the columns that are kept.

    kept : numbers of columns of the Factor, in their new order.
    """
    place = {int(column): position for position, column in enumerate(joint.columns)}
    places = [(new, place[old]) for new, old in enumerate(kept) if old in place]
    columns = np.array([new for new, _ in places], dtype=np.intp)
    return replace(
        joint,
        columns=columns,
        R=joint.R[:, [*(position for _, position in places), joint.R.shape[1] - 1]],
    )


def factor(W: Array, Y: Array, rows: Sequence[int], names: Sequence[str]) -> Factor:
    """Compute the triangular factor of [W Y], joint by joint.

    Parameters
    ----------
    W : ndarray, shape (r, b), rows joint-major, every row of joint 1 first.
    Y : ndarray, shape (r,), torques in N m (N for prismatic joints).
    rows : number of rows of each joint; their sum is r.
    names : the b parameters, in column order.
    """
    r, b = W.shape
    if Y.shape != (r,) or sum(rows) != r or len(names) != b:
        raise ValueError(
            f"W {W.shape}, Y {Y.shape}, {sum(rows)} rows of the joints and {len(names)} names do not "
            "fit together; expected W (r, b), Y (r,), r rows and b names"
        )
    return Factor.of(names, *joint_factors(W, Y, rows, np.zeros(r, dtype=int)))


def joint_factors(
    W: Array, Y: Array, rows: Sequence[int], parts: Array
) -> list[tuple[JointFactor, ...]]:
    """Compute the triangular factor of [W_j Y_j] of every joint, separately for each block of rows.

    A block is, for instance, an interval of time.

    To save memory, only the rows of one part of one joint are copied at a time.

    Parameters
    ----------
    W, Y, rows
        As for `factor`.
    parts : ndarray of int, shape (r,)
        Number of the part of each row, from 0.
    """
    count = int(parts.max(initial=0)) + 1
    by_joint = []
    for j, end in enumerate(np.cumsum(rows)):
        first = end - rows[j]
        C = np.flatnonzero(W[first:end].any(axis=0))
        order = first + np.argsort(parts[first:end], kind="stable")
        ends = np.cumsum(np.bincount(parts[first:end], minlength=count))[:-1]
        factors = []
        for part in np.split(order, ends):
            A = np.vstack([W.T[np.ix_(C, part)], Y[part]])
            if not np.isfinite(A).all():
                raise ValueError(
                    "W or Y holds values that are not finite; leave those samples out of the record"
                )
            factors.append(JointFactor(C, triangularise(A.T), len(part)))
        by_joint.append(factors)
    return list(zip(*by_joint, strict=True))


def merged(parts: Iterable[Sequence[JointFactor]]) -> tuple[JointFactor, ...]:
    """Merge the triangular factors of several blocks of rows into those of all rows, by joint.

    All parts have the same columns.
    """
    return tuple(
        same[0]
        if len(same) == 1
        else JointFactor(
            same[0].columns,
            triangularise(np.vstack([joint.R for joint in same])),
            sum(joint.rows for joint in same),
        )
        for same in zip(*parts, strict=True)
    )
