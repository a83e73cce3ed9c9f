# fdnet with LIGGGHTS and 3-D pictures. Cases and runs lie in the folder that is mounted as /work:
#   docker build -t fdnet .
#   docker run --rm -v "$PWD:/work" -v fdnet-cache:/cache fdnet run cases/quick.toml
FROM debian:13
RUN apt-get update && apt-get install -y --no-install-recommends liggghts python3-venv \
        libegl1 libegl-mesa0 libgl1-mesa-dri libgl1 && rm -rf /var/lib/apt/lists/*
COPY . /src
RUN python3 -m venv /opt/fdnet && /opt/fdnet/bin/pip install --no-cache-dir '/src[view]'
ENV PATH=/opt/fdnet/bin:$PATH XDG_CACHE_HOME=/cache
WORKDIR /work
ENTRYPOINT ["fdnet"]
