"""Cameras on a network, as a test serves them: films over TCP or RTSP that end, stall or die."""

import socket
import struct
import threading
import time
from contextlib import contextmanager
from fractions import Fraction

import av
from tracked import image

PACKET = 7 * 188
RELIABLE = 33
"""The RTP payload type of MPEG-TS."""


def film(frames, rate=25, gop=1):
    """An MPEG-TS film of the tests' moving target: the bytes of each picture; one in `gop` is a
    key frame."""
    parts = [b""]

    class File:
        def write(self, data):
            parts[-1] += bytes(data)
            return len(data)

    with av.open(File(), mode="w", format="mpegts", options={"flush_packets": "1"}) as container:
        stream = container.add_stream("mpeg2video", rate=Fraction(rate))
        stream.width, stream.height, stream.pix_fmt = 160, 100, "yuv420p"
        stream.codec_context.gop_size, stream.codec_context.max_b_frames = gop, 0
        stream.codec_context.bit_rate = 4_000_000
        for k in range(frames):
            picture = av.VideoFrame.from_ndarray(image(k)[..., ::-1].copy(), format="rgb24")
            container.mux(stream.encode(picture))
            parts.append(b"")
        container.mux(stream.encode(None))
    return [part for part in parts if part]


@contextmanager
def served(parts, gap=0.0, then="end", rtsp=False):
    """The address at which one client gets the parts, `gap` seconds apart.

    Args:
        then: "end" closes the connection, "die" resets it, "stall" keeps it open and silent.
    """
    listening, over = socket.create_server(("127.0.0.1", 0)), threading.Event()

    def serve():
        client, _ = listening.accept()
        send = client.sendall
        if rtsp:
            answer_rtsp(client)
            send = rtp(client)
        with client:
            for part in parts:
                send(part)
                time.sleep(gap)
            if then == "stall":
                over.wait(20)
            if then == "die":
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    port = listening.getsockname()[1]
    yield f"rtsp://127.0.0.1:{port}/eye" if rtsp else f"tcp://127.0.0.1:{port}"
    over.set()
    thread.join(10)
    listening.close()


SDP = (
    b"v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=eye\r\nt=0 0\r\nm=video 0 RTP/AVP 33\r\na=control:t\r\n"
)


def answer_rtsp(client):
    """The talk of RTSP (RFC 2326) until the client says PLAY."""
    while True:
        request = b""
        while not request.endswith(b"\r\n\r\n"):
            request += client.recv(1)
        method = request.split()[0]
        number = next(x for x in request.split(b"\r\n") if x.lower().startswith(b"cseq"))
        head, body = b"Session: 1\r\n", b""
        if method == b"OPTIONS":
            head = b"Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN\r\n"
        elif method == b"DESCRIBE":
            head, body = b"Content-Type: application/sdp\r\n", SDP
        elif method == b"SETUP":
            head += b"Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n"
        length = b"Content-Length: %d\r\n" % len(body)
        client.sendall(b"RTSP/1.0 200 OK\r\n" + number + b"\r\n" + head + length + b"\r\n" + body)
        if method == b"PLAY":
            return


def rtp(client):
    """A function that sends MPEG-TS in RTP packets (RFC 2250) inside the RTSP connection."""
    sent = [0]

    def send(part):
        for at in range(0, len(part), PACKET):
            head = struct.pack(">BBHII", 0x80, RELIABLE, sent[0] % 65536, 3000 * sent[0], 7)
            data = head + part[at : at + PACKET]
            client.sendall(b"$\0" + struct.pack(">H", len(data)) + data)
            sent[0] += 1

    return send
