"""Gaussian process regression by numpy, for tests of condition points, and a test of a normal law."""

import numpy as np
from statistics_checks import check_z


class Regression:
    """The posterior of f by solving one system; covariances of (g, ∇g) from the process (test_covariance.py)."""

    def __init__(self, prior, c, mean, sigma):
        self.prior, self.mean, self.sigma, self.points = prior, mean, sigma, np.asarray(c["points"])
        rows, values, noise = [], [], []
        m, dm, s, ds = mean(self.points), mean.gradient(self.points), sigma(self.points), sigma.gradient(self.points)
        for i in range(len(self.points)):
            if not np.isnan(c["values"][i]):
                rows.append((i, [s[i], 0, 0, 0]))
                values.append(c["values"][i] - m[i])
                noise.append(c["noise"][i] ** 2)
            if not np.isnan(c["normals"][i]).any():
                for axis in range(3):
                    what = np.zeros(4)
                    what[0], what[1 + axis] = ds[i, axis], s[i]
                    rows.append((i, what))
                    values.append(c["slopes"][i] * c["normals"][i, axis] - dm[i, axis])
                    noise.append(0.0)
        self.at = np.array([i for i, _ in rows])
        self.what = np.array([w for _, w in rows])
        self.values = np.array(values)
        blocks = prior.joint_covariance(self.points[self.at], self.points[self.at])
        self.gram = np.einsum("ia,ijab,jb->ij", self.what, blocks, self.what) + np.diag(noise)

    def law(self, x):
        """Mean and covariance of f at points x."""
        s = self.sigma(x)
        cross = s[:, None] * np.einsum("ija,ja->ij", self.prior.joint_covariance(x, self.points[self.at])[:, :, 0], self.what)
        mean = self.mean(x) + cross @ np.linalg.solve(self.gram, self.values)
        return mean, self.prior.covariance(x, x) - cross @ np.linalg.solve(self.gram, cross.T)


def check_law(samples, mean, covariance, slack=0.0, what=""):
    """Means and covariances of rows of samples; `slack` of the prior's deviation is allowed for the representation."""
    n, sd = len(samples), np.sqrt(np.maximum(np.diag(covariance), 1e-14))
    check_z(np.sign(d := samples.mean(axis=0) - mean) * np.maximum(np.abs(d) - slack, 0), 0, sd / np.sqrt(n), f"{what} mean")
    c = samples - mean
    error = np.sqrt((np.outer(sd, sd) ** 2 + covariance**2) / n)
    d = c.T @ c / n - covariance
    check_z(np.sign(d) * np.maximum(np.abs(d) - slack, 0), 0, error, f"{what} covariance")
