"""The gallery: public robots in every engine, as one site."""
