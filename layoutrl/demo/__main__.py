"""python -m layoutrl.demo [port=8765]"""

from layoutrl.demo import main

if __name__ == "__main__":
    main()
