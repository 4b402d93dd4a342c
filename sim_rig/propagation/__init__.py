"""Physics of the radio channel: path loss, fading and shadowing."""
