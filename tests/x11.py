"""A display without a screen (Xvfb), and as much of the X11 protocol as looks at it and plays its user."""

import select
import shutil
import socket
import struct
import subprocess

KEY_PRESS, KEY_RELEASE, BUTTON_PRESS, BUTTON_RELEASE, MOTION = 2, 3, 4, 5, 6
ESCAPE = 9  # its key code


class Xvfb:
    """Runs one on a free display while it is entered; `available` tells whether it is installed.

    Not on one of the first ten displays unless told: Open MPI's launcher looks there for graphics cards, and what does not tell it
    to leave that waits for a server that a test has stopped.
    """

    available = shutil.which("Xvfb") is not None

    def __init__(self, width, height, first=10):
        self.first = first
        self.size = f"{width}x{height}x24"

    def __enter__(self):
        for number in range(self.first, self.first + 50):
            self.process = subprocess.Popen(["Xvfb", f":{number}", "-displayfd", "1", "-screen", "0", self.size, "-nolisten", "tcp"],
                                            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
            if not select.select([self.process.stdout], [], [], 20)[0]:
                break
            if self.process.stdout.readline():
                self.number = number
                self.name = f":{number}"
                return self
            self.__exit__()  # the display is taken
        self.__exit__()
        raise RuntimeError("Xvfb does not start")

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(timeout=20)


class Client:
    def __init__(self, number):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(20)
        self.socket.connect(f"/tmp/.X11-unix/X{number}")
        self.socket.sendall(struct.pack("<cxHHHHxx", b"l", 11, 0, 0, 0))
        head = self.read(8)
        if head[0] != 1:
            raise RuntimeError("the X server refuses")
        body = self.read(4 * struct.unpack_from("<H", head, 6)[0])
        vendor, = struct.unpack_from("<H", body, 16)
        formats = body[21]
        at = 32 + (vendor + 3) // 4 * 4 + 8 * formats
        self.root, = struct.unpack_from("<I", body, at)
        self.width, self.height = struct.unpack_from("<HH", body, at + 20)

    def read(self, count):
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            if not part:
                raise RuntimeError("the X server is gone")
            data += part
        return data

    def request(self, opcode, data, body):
        body += bytes(-len(body) % 4)
        self.socket.sendall(struct.pack("<BBH", opcode, data, 1 + len(body) // 4) + body)

    def reply(self):
        while True:
            head = self.read(32)
            if head[0] == 0:
                raise RuntimeError(f"X error {head[1]}")
            if head[0] == 1:
                return head, self.read(4 * struct.unpack_from("<I", head, 4)[0])

    def picture(self):
        """(width, height, bytes: RGBA row by row) of the whole screen."""
        self.request(73, 2, struct.pack("<IhhHHI", self.root, 0, 0, self.width, self.height, 0xFFFFFFFF))
        bgrx = self.reply()[1][:4 * self.width * self.height]
        rgba = bytearray(b"\xff" * len(bgrx))
        for channel in range(3):
            rgba[channel::4] = bgrx[2 - channel::4]
        return self.width, self.height, bytes(rgba)

    def fake(self, kind, detail, x=0, y=0):
        """What a keyboard or mouse would send, by the extension XTEST."""
        if not hasattr(self, "xtest"):
            self.request(98, 0, struct.pack("<Hxx", 5) + b"XTEST")
            self.xtest = self.reply()[0][9]
        self.request(self.xtest, 2, struct.pack("<BBxxII8xhh8x", kind, detail, 0, self.root, x, y))
        self.request(43, 0, b"")  # GetInputFocus: answered once it was done
        self.reply()

    def drag(self, start, end):
        self.fake(MOTION, 0, *start)
        self.fake(BUTTON_PRESS, 1)
        self.fake(MOTION, 0, *end)
        self.fake(BUTTON_RELEASE, 1)

    def press(self, key):
        self.fake(KEY_PRESS, key)
        self.fake(KEY_RELEASE, key)
