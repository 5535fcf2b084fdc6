"""Render settings -> `settings` of the description."""


def describe(sync):
    scene = sync.scene
    gpis = scene.gpis
    if scene.render.use_motion_blur:
        sync.warn("Motion blur is off in this picture: the GPIS engine does not render it.")
    if scene.render.use_freestyle:
        sync.warn("Freestyle is on: the GPIS engine does not draw its lines.")
    if scene.render.film_transparent:
        sync.warn("The background stays in this picture: the GPIS engine does not render Transparent film.")
    return {
        "max_bounces": gpis.max_bounces if gpis.use_max_bounces else None,
        "missed_root": gpis.missed_root,
        "filter": {"type": gpis.filter_type.lower(), "width": gpis.filter_width},
        "clamp": gpis.clamp,
        "light_sampling": gpis.light_sampling,
    }
