"""Faults planted into robot files, one number at a time: is each caught and named?"""
