# docker build -t pdsuite .      then   docker run --rm -v "$PWD:/work" pdsuite pdmesh build plate.geo
FROM python:3.13-slim-bookworm

RUN apt-get update -qq \
    && apt-get install -y -qq --no-install-recommends make libgl1 libglu1-mesa libxft2 libxcursor1 libxinerama1 libxrender1 \
        libxfixes3 libxext6 libfontconfig1 libgomp1 \
    && rm -rf /var/lib/apt/lists/*
COPY . /opt/pdsuite
WORKDIR /opt/pdsuite
# An image whose demo does not run is not built
RUN make demo && rm -rf demo && useradd --create-home user
ENV PATH="/opt/pdsuite/.venv/bin:$PATH"
USER user
WORKDIR /work
CMD ["pdmesh", "--help"]
