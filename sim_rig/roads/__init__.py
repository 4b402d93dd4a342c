"""Who drives where: every source of movement answers one question, `Road.cars_at`."""
