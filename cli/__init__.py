"""The command line of mcsettle: parse, call, print.

Depends on: nothing; ``mcsettle.cli.app`` holds the commands.
"""
