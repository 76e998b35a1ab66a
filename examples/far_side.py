#!/usr/bin/env python3
"""Far side of docs/link.md over a network, with the simulated robot of far_side_local.py.

    far_side.py KEYS [--listen HOST:PORT | --connect HOST:PORT] [--arm N] [--wall AXIS POSITION] [--start X Y Z]

Takes the place of `frhc-link far` and of the robot. KEYS is a folder of `frhc-link key new` with authority.pem,
far.pem and far.key. Runs until SIGTERM or SIGINT. Exit code 2: invalid arguments; 4: a key or the port cannot be
opened. A far side that listens logs refused certificates; RUST_LOG sets zenoh's log. Needs the package frhc
(pip install ./python).
"""
import zenoh

import frhc
from far_side_local import CAPABILITY, Parser, arguments, run


def main():
    parser = Parser(description="Far side of docs/link.md over a network.", allow_abbrev=False)
    parser.add_argument("keys", help="folder with authority.pem, far.pem and far.key")
    end = parser.add_mutually_exclusive_group()
    end.add_argument("--listen", metavar="HOST:PORT", help="UDP address (default 0.0.0.0:7447)")
    end.add_argument("--connect", metavar="HOST:PORT", help="UDP address of the near end or of a router")
    args = arguments(parser)
    zenoh.init_log_from_env_or("error,zenoh_link_commons::quic::unicast=warn")
    try:
        far = frhc.FarSide(args.arm, keys=args.keys, listen=args.listen, connect=args.connect, capability=CAPABILITY)
    except ValueError as error:
        parser.error(f"--listen and --connect: {error}")
    except OSError as error:
        parser.exit(4, f"{parser.prog}: {error}\n")
    run(args, far)


if __name__ == "__main__":
    main()
