"""The brushes of PaintedFields.apply in plain numpy on whole arrays, for tests to compare with: written from the formulas
in the native files' heads, node by node and without leaves."""

import numpy as np

FALLOFFS = {
    "smooth": lambda p: 3 * p**2 - 2 * p**3,
    "smoother": lambda p: 6 * p**5 - 15 * p**4 + 10 * p**3,
    "sphere": lambda p: np.sqrt(np.maximum(2 * p - p**2, 0)),
    "root": np.sqrt,
    "sharp": lambda p: p**2,
    "sharper": lambda p: p**4,
    "inverse_square": lambda p: 2 * p - p**2,
    "linear": lambda p: p,
    "constant": np.ones_like,
}


def positions(origin, voxel_size, shape):
    axes = [origin[i] + voxel_size[i] * np.arange(shape[i]) for i in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def six(values):
    """Mean over the six neighbours; beyond the ends stands the nearest node."""
    padded = np.pad(values, [(1, 1)] * 3 + [(0, 0)] * (values.ndim - 3), mode="edge")
    inner = [slice(1, -1)] * 3
    total = 0
    for axis in range(3):
        for part in (slice(None, -2), slice(2, None)):
            total = total + padded[tuple(part if i == axis else inner[i] for i in range(3))]
    return total / 6


def gradient(mean, voxel_size):
    return np.stack(np.gradient(mean, *voxel_size), axis=-1)


def trilinear(values, points, origin, voxel_size):
    u = (points - origin) / voxel_size
    last = np.array(values.shape[:3]) - 1
    u = np.clip(u, 0, last)
    cell = np.minimum(np.floor(u).astype(int), last - 1)
    w = u - cell
    total = 0
    for corner in np.ndindex(2, 2, 2):
        share = np.prod(np.where(corner, w, 1 - w), axis=-1)
        total = total + share * values[tuple(np.moveaxis(cell + corner, -1, 0))]
    return total


def full(a):
    """(…, 6) entries xx,yy,zz,xy,xz,yz -> (…, 3, 3)."""
    return a[..., [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(*a.shape[:-1], 3, 3)


def entries(matrix):
    return matrix[..., [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


class Reference:
    """Arrays mean, deviation (X,Y,Z), tensor (X,Y,Z,6), albedo (X,Y,Z,3), in single precision between dabs."""

    def __init__(self, mean, origin, voxel_size, sigma, length_scale):
        self.origin, self.voxel_size = np.asarray(origin, float), np.broadcast_to(np.asarray(voxel_size, float), 3)
        self.mean = mean.astype(np.float32)
        self.x = positions(self.origin, self.voxel_size, mean.shape)
        self.deviation = np.full(mean.shape, sigma, np.float32)
        self.tensor = np.zeros((*mean.shape, 6), np.float32)
        self.tensor[..., :3] = length_scale**2
        self.albedo = np.ones((*mean.shape, 3), np.float32)

    def apply(self, channel, operation, centers, radius, strength, directions=None, value=None, **brush):
        count = len(centers)
        directions = np.zeros((count, 3)) if directions is None else np.asarray(directions, float)
        radius, strength = np.broadcast_to(radius, count), np.broadcast_to(strength, count)
        for i in range(count):
            self._dab(channel, operation, np.asarray(centers[i], float), radius[i], strength[i], directions[i], value, **brush)

    def _dab(
        self,
        channel,
        operation,
        center,
        radius,
        strength,
        direction,
        value,
        ratios=(1, 1, 1),
        falloff="smooth",
        curve=None,
        symmetry=(False, False, False),
    ):
        images = [(center, direction)]
        for axis in range(3):
            if symmetry[axis]:
                sign = np.where(np.arange(3) == axis, -1.0, 1.0)
                images += [(c * sign, d * sign) for c, d in images]
        distances = np.stack([np.linalg.norm(self.x - c, axis=-1) for c, _ in images])
        nearest = distances.min(axis=0)
        shares = (distances <= nearest + 1e-9 * radius).astype(float)
        shares /= shares.sum(axis=0)  # equally near images are averaged
        phi = self._phi(falloff, curve)
        inside = nearest < radius
        a = np.where(inside, strength * phi(np.minimum(nearest / radius, 1)), 0)

        if channel == "mean":
            self.mean = self._mean(operation, a, radius, value, images, shares, distances, phi).astype(np.float32)
        elif channel == "deviation":
            log = np.log(self.deviation.astype(float))
            new = np.exp(log + a * self._log_change(operation, log, value))
            self.deviation = np.where(a > 0, new, self.deviation).astype(np.float32)
        elif channel == "albedo":
            old = self.albedo.astype(float)
            goal = np.asarray(value, float) if operation == "set" else six(old)
            self.albedo = (old + a[..., None] * (goal - old)).astype(np.float32)
        else:
            self.tensor = self._tensor(channel, operation, a, value, ratios, images, shares).astype(np.float32)

    @staticmethod
    def _phi(falloff, curve):
        if curve is None:
            return lambda distance: FALLOFFS[falloff](1 - distance)
        return lambda distance: np.interp(distance, np.linspace(0, 1, len(curve)), curve)

    @staticmethod
    def _log_change(operation, log, value):
        if operation == "set":
            return np.log(value) - log
        return np.log(value) if operation == "add" else six(log) - log

    def _mean(self, operation, a, radius, value, images, shares, distances, phi):
        old = self.mean.astype(float)
        if operation in ("inflate", "deflate"):
            return old + a * value * radius * (-1 if operation == "inflate" else 1)
        if operation == "smooth":
            return old + a * (six(old) - old)
        if operation == "grab":
            drag = sum(share[..., None] * d for share, (_, d) in zip(shares, images, strict=True))
            moved = trilinear(old, self.x - a[..., None] * drag, self.origin, self.voxel_size)
            return np.where(a > 0, moved, old)
        slope = gradient(old, self.voxel_size)
        goal = 0
        for share, distance in zip(shares, distances, strict=True):
            w = np.where(distance < radius, phi(np.minimum(distance / radius, 1)), 0)
            point, value, steep = ((w[..., None] * v).sum(axis=(0, 1, 2)) / w.sum() for v in (self.x, old[..., None], slope))
            goal = goal + share * (value + (self.x - point) @ steep)
        return old + a * (goal - old)

    def _tensor(self, channel, operation, a, value, ratios, images, shares):
        old = self.tensor.astype(float)
        weight = a[..., None]
        if channel == "length_scale":
            log = np.log(np.linalg.det(full(old))) / 6
            change = self._log_change(operation, log, value)
            return np.where(weight > 0, old * np.exp(2 * a * change)[..., None], old)
        if operation == "smooth":
            return (1 - weight) * old + weight * six(old)
        slope = gradient(self.mean.astype(float), self.voxel_size)
        steepness = np.linalg.norm(slope, axis=-1, keepdims=True)
        e3 = slope / np.where(steepness > 0, steepness, 1)
        squares = np.asarray(ratios, float) ** 2 / np.prod(ratios) ** (2 / 3)
        determinant = np.linalg.det(full(old))
        goal, directed = 0, steepness[..., 0] > 0
        for share, (_, direction) in zip(shares, images, strict=True):
            t = direction / np.linalg.norm(direction)
            across = t - e3 * (e3 @ t)[..., None]
            length = np.linalg.norm(across, axis=-1, keepdims=True)
            directed &= (length[..., 0] > 1e-6) | (share == 0)
            e1 = across / np.where(length > 0, length, 1)
            e2 = np.cross(e3, e1)
            b = sum(q * e[..., :, None] * e[..., None, :] for q, e in zip(squares, (e1, e2, e3), strict=True))
            goal = goal + share[..., None] * entries(b)
        goal = goal * np.cbrt(determinant)[..., None]
        mixed = (1 - weight) * old + weight * goal
        mixed = mixed * np.cbrt(determinant / np.linalg.det(full(mixed)))[..., None]
        return np.where((weight > 0) & directed[..., None], mixed, old)
