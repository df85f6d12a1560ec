"""Runs a second thread when the lock comes: Landlock would not reach it."""

import threading

threading.Thread(target=threading.Event().wait, daemon=True).start()


def main(_frames_in, _frames_out):
    pass
